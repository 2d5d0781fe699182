"""Many flies or worms as one Gymnasium vector environment, over the native batch."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flyrl.envs.config import Observation, config_for
from flyrl.envs.core import BatchedEnv
from flyrl.envs.options import action_space, action_vectors, episode_with_options, observation_space
from flyrl.envs.registration import limited_spec
from flyrl.envs.rendering import RENDERING, Drawn, View, check_render_mode
from flyrl.envs.task_batch import Transition
from flyrl.simulation.marks import PLAIN
from flyrl.simulation.randomisation import UNVARIED, Randomisation
from flyrl.simulation.rendering import Camera
from flyrl.tasks import RUNNING, Episode
from flyrl.validation import random_seed, whole_number


class FlyrlVectorEnv(VectorEnv[Any, NDArray[Any], NDArray[Any]]):
    """`num_envs` flies or worms on native threads; the other arguments are those of `EnvConfig`.

    `gymnasium.make_vec` makes one. Environment i gives the same bits as the single environment
    with its seed. A copy, deep or by pickle, is made anew from the settings, and must be reset.

    Parameters
    ----------
    num_envs
        Number of flies.
    num_threads
        Native threads; 0 takes one per CPU.
    autoreset_mode
        Gymnasium's NEXT_STEP (its default), SAME_STEP or DISABLED.
    max_episode_steps
        Decisions after which an episode is truncated, beside the task's own time limit: what the
        wrapper TimeLimit does to a single environment. The outcome of such an end stays "running".
    render_mode
        None or "rgb_array".
    camera, overlay, width, height
        How pictures look: see `flyrl.envs.rendering.View`.

    Raises
    ------
    ValueError
        An argument that is not allowed.
    """

    def __init__(
        self,
        num_envs: int = 1,
        num_threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        camera: Camera = "follow",
        overlay: Drawn = PLAIN,
        width: int = 640,
        height: int = 480,
        **config: Any,
    ) -> None:
        if max_episode_steps is not None:
            whole_number("max_episode_steps", max_episode_steps, 1, 2**31)
        self.render_mode = check_render_mode(render_mode)
        self.config = config_for(type(self), config)
        view = View(camera, overlay, width, height)
        self.core = BatchedEnv(self.config, num_envs, num_threads, view)
        num_envs = self.num_envs = self.core.num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**RENDERING, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = action_space(self.core.task)
        self.single_observation_space = observation_space(self.core.task)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._done = np.zeros(num_envs, dtype=bool)
        self._max_episode_steps = max_episode_steps
        self._elapsed_steps = np.zeros(num_envs, dtype=np.int64)
        self._is_varied = np.zeros(num_envs, dtype=bool)
        self._drawn = {item.name: np.zeros(num_envs) for item in fields(Randomisation)}
        self._running = np.full(num_envs, self.outcomes.index(RUNNING))
        self._settings = {
            "num_envs": num_envs,
            "num_threads": num_threads,
            "autoreset_mode": autoreset_mode,
            "max_episode_steps": max_episode_steps,
            "render_mode": render_mode,
            **vars(view),
            **config,
        }
        self._spec: EnvSpec | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._settings), (), {"_spec": self._spec}

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made it from; `max_episode_steps` is the limit, in decisions."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        limits = (self.core.max_decisions, self._max_episode_steps)
        self._spec = limited_spec(spec, min((each for each in limits if each), default=None))

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes by code, as in `info["outcome"]`."""
        return self.core.task.outcomes

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; an integer seed s gives environment i the seed s + i.

        The option "reset_mask", (num_envs,) of bool, resets only some; the other options are
        those of `FlyrlEnv.reset`, for every environment that is reset.
        """
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise ValueError(
                f"reset option 'reset_mask' must be {self.num_envs} bools; got {mask.dtype} of "
                f"shape {mask.shape}"
            )
        seeds: list[int | None]
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed has {len(seeds)} entries; there are {self.num_envs} envs")
        else:
            seeds = [random_seed(seed) + i for i in range(self.num_envs)]
        ids = np.flatnonzero(mask)
        episodes = [
            episode_with_options(self.core.draw_episode(int(i), seeds[i]), options) for i in ids
        ]
        observation = self._start(ids, episodes)
        self._done[ids] = False
        return observation, self._info(self._running, np.zeros(self.num_envs, dtype=bool))

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Hold one action per body for a decision interval."""
        actions = action_vectors(self.core.task, actions)
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            return self._step_next(actions)
        if self.autoreset_mode == AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError(
                f"environments {np.flatnonzero(self._done).tolist()} are done; reset them with "
                "the option 'reset_mask' before the next step"
            )
        transition = self._limited(self.core.step(actions))
        done, observation = transition.done, transition.observation
        final: dict[str, Any] = {}
        outcome_code, is_success = transition.outcome_code, transition.is_success
        if self.autoreset_mode == AutoresetMode.DISABLED:
            self._done = done
        elif done.any():
            final = {
                "final_obs": _rows(observation, done),
                "final_info": self._info(outcome_code, is_success, done),
                "_final_obs": done,
                "_final_info": done.copy(),
            }
            observation = self._start(np.flatnonzero(done))
            outcome_code = np.where(done, self._running, outcome_code)
            is_success = is_success & ~done
        return (
            observation,
            transition.reward,
            transition.terminated,
            transition.truncated,
            self._info(outcome_code, is_success) | final,
        )

    def _step_next(
        self, actions: NDArray[Any]
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Reset the flies that were done, with a reward of 0, and step the others."""
        starting = self._done
        if not starting.any():
            transition = self._limited(self.core.step(actions))
        else:
            moving = np.flatnonzero(~starting)
            self._start(np.flatnonzero(starting))
            transition = self._limited(self.core.step(actions, ids=moving), moving)
            transition = _mask(transition, starting)
        self._done = transition.done
        return (
            transition.observation,
            transition.reward,
            transition.terminated,
            transition.truncated,
            self._info(transition.outcome_code, transition.is_success),
        )

    def _start(
        self, ids: NDArray[np.intp], episodes: Sequence[Episode] | None = None
    ) -> Observation:
        """Start episodes, the given ones or those drawn next."""
        observation = self.core.reset(ids=ids, episodes=episodes)
        self._elapsed_steps[ids] = 0
        for i in ids:
            if (episode := self.core.episodes[i]) is not None:
                self._is_varied[i] = episode.randomisation != UNVARIED
                for name, values in self._drawn.items():
                    values[i] = getattr(episode.randomisation, name)
        return observation

    def _info(
        self,
        outcome_code: NDArray[np.int64],
        is_success: NDArray[np.bool_],
        mask: NDArray[np.bool_] | bool = True,
    ) -> dict[str, Any]:
        """What single environments have in `info`, with masks as SyncVectorEnv makes them."""
        facts: dict[str, Any] = {
            "outcome": outcome_code,
            "is_success": is_success,
            "time_s": self.core.state.time,
            **self.core.failure_info(),
        }
        if self.config.scene.terrain.random:
            facts["ground"] = self.core.grounds()
        info = _only(facts, np.full(self.num_envs, mask))
        is_varied = self._is_varied & mask
        if is_varied.any():
            info |= _only({"randomisation": self._drawn}, is_varied)
        return info

    def _limited(
        self, transition: Transition, moved: NDArray[np.intp] | slice = slice(None)
    ) -> Transition:
        """Count a decision, and truncate what has had its `max_episode_steps`."""
        if self._max_episode_steps is None:
            return transition
        self._elapsed_steps[moved] += 1
        is_over = self._elapsed_steps >= self._max_episode_steps
        return replace(transition, truncated=transition.truncated | is_over)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Pictures of the bodies, (height, width, 3) each, or None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self.core.render(i) for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the renderer; to reset, step or render from now on is an error."""
        self.core.close()


def _rows(observation: Observation, mask: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Observations of the masked environments as an object array, as Gymnasium's own envs do."""
    rows = np.full(len(mask), None, dtype=object)
    for i in np.flatnonzero(mask):
        if isinstance(observation, dict):
            rows[i] = {name: values[i] for name, values in observation.items()}
        else:
            rows[i] = observation[i]
    return rows


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


def _mask(transition: Transition, starting: NDArray[np.bool_]) -> Transition:
    """Make a transition of the environments that only started their episode a neutral one."""
    running = transition.outcomes.index(RUNNING)
    return replace(
        transition,
        reward=np.where(starting, 0.0, transition.reward),
        terminated=transition.terminated & ~starting,
        truncated=transition.truncated & ~starting,
        outcome_code=np.where(starting, running, transition.outcome_code),
        is_success=transition.is_success & ~starting,
    )
