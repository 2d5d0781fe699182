"""Settings, reset options, info and copies, shared by all interfaces to an environment."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from typing import Any, Final

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from flyrl.envs.bodies import RENDERING, View
from flyrl.envs.config import Observation, config_for
from flyrl.envs.core import BatchedEnv
from flyrl.simulation.batch import Ids
from flyrl.simulation.randomisation import UNVARIED
from flyrl.tasks import RUNNING, Episode
from flyrl.validation import float_array, known_keys

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
        Arguments of the constructor besides `settings`, by name.
    settings
        Fields of a `View` and of an `EnvConfig`, and settings of the task.

    Attributes
    ----------
    core
        The batch of simulations.
    config
        The settings.
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
        """Gymnasium's spec; `max_episode_steps` is the limit, in decisions.

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

    def _reset(
        self,
        seeds: Sequence[int | None],
        options: Sequence[Mapping[str, Any] | None],
        ids: Ids | None = None,
    ) -> Observation:
        """Start episodes that are drawn with seeds and changed by options, one of each per id."""
        sims = np.arange(self.core.num_envs) if ids is None else ids
        episodes = [
            episode_with_options(self.core.draw_episode(int(i), seed), given)
            for i, seed, given in zip(sims, seeds, options, strict=True)
        ]
        return self.core.reset(ids=sims, episodes=episodes)

    def _info(
        self, outcome_code: Any = None, is_success: Any = False, mask: Any = True
    ) -> dict[str, Any]:
        """Gymnasium's `info` of the masked environments, as its SyncVectorEnv has it, (n,) by key.

        Without arguments, that of a reset.
        """
        n = self.core.num_envs
        if outcome_code is None:
            outcome_code = self.outcomes.index(RUNNING)
        facts = {
            "outcome": np.full(n, outcome_code),
            "is_success": np.full(n, is_success),
            "time_s": self.core.state.time,
            **self.core.failure_info(),
        }
        if self.config.scene.terrain.random:
            facts["ground"] = self.core.grounds()
        info = _only(facts, np.full(n, mask))
        flies = [episode.randomisation if episode else UNVARIED for episode in self.core.episodes]
        is_varied = np.full(n, mask) & [fly != UNVARIED for fly in flies]
        if is_varied.any():
            rows = [fly.numbers() for fly in flies]
            drawn = {name: np.array([row[name] for row in rows]) for name in rows[0]}
            info |= _only({"randomisation": drawn}, is_varied)
        return info


def _only(info: Mapping[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Values of the masked environments, 0 of the others, and the mask itself under `_key`."""
    only: dict[str, Any] = {}
    for key, values in info.items():
        if isinstance(values, Mapping):
            only[key] = _only(values, mask)
        else:
            only[key] = np.where(mask, values, np.zeros((), values.dtype))
        only[f"_{key}"] = mask.copy()
    return only


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
    changes: dict[str, Any] = {}
    for option, value in given.items():
        name = _OPTIONS[option]
        drawn = getattr(episode, name)
        if isinstance(drawn, tuple):
            changes[name] = tuple(float_array(option, value, (len(drawn),)).tolist())
        elif isinstance(value, Mapping):  # of a randomisation, what it does not name stays
            changes[name] = {**asdict(drawn), **value}
        else:
            changes[name] = value
    if "command" in changes and _leads_to_goal(episode):
        changes.setdefault("goal", changes["command"][-2:])
    changed = replace(episode, **changes)
    if _leads_to_goal(episode) and not _leads_to_goal(changed):
        raise ValueError(
            f"reset option 'goal' must be the last point of the command, {changed.command[-2:]}; "
            f"got {changed.goal}"
        )
    return changed


def _leads_to_goal(episode: Episode) -> bool:
    """Whether the command is a path, whose last point is the goal."""
    return episode.goal != () and episode.command[-2:] == episode.goal
