"""Many flies or worms as one Gymnasium vector environment, over the native batch."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flyrl.envs.config import config_for
from flyrl.envs.core import BatchedEnv, Observation, Transition
from flyrl.envs.options import episode_with_options
from flyrl.envs.rendering import RENDERING, Renderer, check_render_mode, make_renderer
from flyrl.envs.spaces import action_space, observation_space
from flyrl.tasks import DECISIONS_LOST, IS_FAILURE
from flyrl.validation import random_seed, whole_number


class FlyrlVectorEnv(VectorEnv[Any, NDArray[Any], NDArray[Any]]):
    """`num_envs` flies or worms on native threads; the other arguments are those of `EnvConfig`.

    `gymnasium.make_vec` makes one. Environment i gives the same bits as the single environment
    with its seed.

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
        wrapper TimeLimit does to a single environment. Of such an end, "outcome" stays "running".
    render_mode
        None or "rgb_array".

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
        **config: Any,
    ) -> None:
        if max_episode_steps is not None:
            whole_number("max_episode_steps", max_episode_steps, 1, 2**31)
        self.render_mode = check_render_mode(render_mode)
        self.config = config_for(type(self), config)
        self.core = BatchedEnv(self.config, num_envs, num_threads)
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
        self._renderer: Renderer | None = None

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
        observation = self.core.reset(ids=ids, episodes=episodes)
        self._done[ids] = False
        self._elapsed_steps[ids] = 0
        return observation, self._info(
            np.full(self.num_envs, "running"), np.zeros(self.num_envs, dtype=bool)
        )

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Hold one action per body for a decision interval."""
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            return self._step_next(actions)
        if self.autoreset_mode == AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError(
                f"environments {np.flatnonzero(self._done).tolist()} are done; reset them with "
                "the option 'reset_mask' before the next step"
            )
        transition = self._limited(self.core.step(actions))
        info = self._info(transition.outcome, transition.is_success)
        observation = transition.observation
        if self.autoreset_mode == AutoresetMode.DISABLED:
            self._done = transition.done
        elif transition.done.any():
            ids = np.flatnonzero(transition.done)
            info["final_obs"] = _rows(observation, transition.done)
            names = ("outcome", "is_success", IS_FAILURE, DECISIONS_LOST)
            info["final_info"] = {name: info[name].copy() for name in names if name in info}
            info["_final_obs"] = info["_final_info"] = transition.done.copy()
            observation = self.core.reset(ids=ids)
            self._elapsed_steps[ids] = 0
        return (
            observation,
            transition.reward,
            transition.terminated,
            transition.truncated,
            info,
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
            self.core.reset(ids=np.flatnonzero(starting))
            transition = self._limited(self.core.step(actions, ids=moving))
            transition = _mask(transition, starting)
            self._elapsed_steps[starting] = 0
        self._done = transition.done
        return (
            transition.observation,
            transition.reward,
            transition.terminated,
            transition.truncated,
            self._info(transition.outcome, transition.is_success),
        )

    def _info(self, outcome: NDArray[np.str_], is_success: NDArray[np.bool_]) -> dict[str, Any]:
        everyone = np.ones(self.num_envs, dtype=bool)
        facts: dict[str, Any] = self.core.failure_info()
        if self.config.scene.terrain.random:
            facts["ground"] = self.core.grounds()
        return {
            **facts,
            **{f"_{name}": everyone.copy() for name in facts},
            "outcome": outcome.astype(object),
            "_outcome": everyone,
            "is_success": is_success,
            "_is_success": everyone.copy(),
            "time_s": self.core.state.time.copy(),
            "_time_s": everyone.copy(),
        }

    def _limited(self, transition: Transition) -> Transition:
        """Count a decision, and truncate what has had its `max_episode_steps`."""
        if self._max_episode_steps is None:
            return transition
        self._elapsed_steps += 1
        is_over = self._elapsed_steps >= self._max_episode_steps
        return replace(transition, truncated=transition.truncated | is_over)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Pictures of the bodies, (480, 640, 3) each, or None without a render mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = make_renderer(self.config)
        return tuple(
            self._renderer.render(self.core.batch, i, goal=episode.goal if episode else ())
            for i, episode in enumerate(self.core.episodes)
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _rows(observation: Observation, mask: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Observations of the masked environments as an object array, as Gymnasium's own envs do."""
    rows = np.full(len(mask), None, dtype=object)
    for i in np.flatnonzero(mask):
        if isinstance(observation, dict):
            rows[i] = {name: values[i] for name, values in observation.items()}
        else:
            rows[i] = observation[i]
    return rows


def _mask(transition: Transition, starting: NDArray[np.bool_]) -> Transition:
    """Make a transition of the environments that only started their episode a neutral one."""
    return Transition(
        observation=transition.observation,
        reward=np.where(starting, 0.0, transition.reward),
        terminated=transition.terminated & ~starting,
        truncated=transition.truncated & ~starting,
        outcome=np.where(starting, "running", transition.outcome),
        is_success=transition.is_success & ~starting,
    )
