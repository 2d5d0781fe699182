"""What all interfaces to an environment share: settings, reset options, facts and copies."""

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any, Final

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from flyrl.envs.bodies import RENDERING, View
from flyrl.envs.config import config_for
from flyrl.envs.core import BatchedEnv
from flyrl.simulation.randomisation import Randomisation
from flyrl.tasks import Episode
from flyrl.validation import known_keys

_VIEW: Final = [item.name for item in fields(View)]

_OPTIONS: Final = {
    item.name.removesuffix("_w"): item.name
    for item in fields(Episode)
    if item.name not in ("seed", "difficulty")
}
"""Fields of an episode by option of `reset`."""


class Adapter:
    """An interface to a `BatchedEnv`.

    Parameters
    ----------
    arguments
        What the constructor takes besides `settings`, by name.
    settings
        Fields of a `View` and of an `EnvConfig`, and settings of the task.

    Attributes
    ----------
    core
        The batch of simulations.
    config
        What is simulated.
    """

    metadata: dict[str, Any] = RENDERING
    _max_episode_steps: int | None = None
    _spec: EnvSpec | None = None

    def _make_core(self, arguments: Mapping[str, Any], settings: Mapping[str, Any]) -> None:
        self._arguments = {**arguments, **settings}
        self.render_mode: str | None = arguments["render_mode"]
        if self.render_mode not in (None, *RENDERING["render_modes"]):
            raise ValueError(f"render_mode is {self.render_mode!r}; it must be None or 'rgb_array'")
        view = View(**{name: settings[name] for name in _VIEW if name in settings})
        rest = {name: value for name, value in settings.items() if name not in _VIEW}
        self.config = config_for(rest, arguments.get("config"), (*arguments, *_VIEW))
        threads = arguments.get("num_threads", 1)
        self.core = BatchedEnv(self.config, arguments.get("num_envs", 1), threads, view)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._arguments), (), {"_spec": self._spec}

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made it from; `max_episode_steps` is the limit, in decisions.

        The limit is that of each environment, not of its id, since it depends on the settings.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            given = (spec.max_episode_steps, self._max_episode_steps, self.core.max_decisions)
            limit = min((each for each in given if each), default=None)
            spec = replace(spec, max_episode_steps=limit)
        self._spec = spec

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes by code, as in `info["outcome"]`."""
        return self.core.task.outcomes

    def _facts(self, outcome_code: Any, is_success: Any) -> dict[str, NDArray[Any]]:
        """What `info` holds after a decision, besides the randomisation, (n,) by key."""
        facts = {
            "outcome": outcome_code,
            "is_success": is_success,
            "time_s": self.core.state.time,
            **self.core.failure_info(),
        }
        if self.config.scene.terrain.random:
            facts["ground"] = self.core.grounds()
        return facts


def row_of(observation: Any, i: Any) -> Any:
    """Observation of one simulation, out of that of all."""
    if isinstance(observation, dict):
        return {name: values[i] for name, values in observation.items()}
    return observation[i]


def episode_with_options(episode: Episode, options: Mapping[str, Any] | None) -> Episode:
    """Replace parts of a drawn episode.

    Raises
    ------
    ValueError
        If an option is unknown, has the wrong number of values, or one that is not allowed.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options must be a mapping or None, got {options!r}")
    if not options:
        return episode
    known_keys("reset(options)", options, (*_OPTIONS, "episode"))
    given = {name: value for name, value in options.items() if value is not None}
    episode = given.pop("episode", episode)
    if not isinstance(episode, Episode):
        raise ValueError(f"reset option 'episode' must be an Episode; got {episode!r}")
    changes = {
        _OPTIONS[name]: _replacing(getattr(episode, _OPTIONS[name]), name, value)
        for name, value in given.items()
    }
    if "command" in changes and _leads_to_goal(episode):
        changes.setdefault("goal", changes["command"][-2:])
    changed = replace(episode, **changes)
    if _leads_to_goal(episode) and not _leads_to_goal(changed):
        raise ValueError(
            f"reset option 'goal' must be the last point of the command, {changed.command[-2:]}; "
            f"got {changed.goal}"
        )
    return changed


def _replacing(drawn: Any, name: str, given: Any) -> Any:
    """Value of an option that replaces what was drawn."""
    if isinstance(drawn, tuple):
        numbers = np.asarray(given, dtype=np.float64)
        if numbers.shape != (len(drawn),) or not np.isfinite(numbers).all():
            raise ValueError(
                f"reset option {name!r} must be {len(drawn)} finite numbers; got {given!r}"
            )
        return tuple(numbers.tolist())
    if isinstance(drawn, Randomisation):
        if not isinstance(given, Mapping):
            raise ValueError(
                f"reset option 'randomisation' must be a dict of values by name; got {given!r}"
            )
        known_keys("reset option 'randomisation'", given, [item.name for item in fields(drawn)])
        return replace(drawn, **given)
    return given


def _leads_to_goal(episode: Episode) -> bool:
    """Whether the command is a path, whose last point is the goal."""
    return episode.goal != () and episode.command[-2:] == episode.goal
