"""Many flies as one Gymnasium vector environment, over the native batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv, EnvConfig, Observation, Transition
from flyrl.envs.options import episode_with_options
from flyrl.envs.spaces import action_space, observation_space


class FlyVectorEnv(VectorEnv[Any, NDArray[np.float32], NDArray[Any]]):
    """`num_envs` flies on native threads; the other arguments are those of `EnvConfig`.

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
    """

    def __init__(
        self,
        num_envs: int = 1,
        num_threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **config: Any,
    ) -> None:
        self.config = EnvConfig(**config)
        self.core = BatchedEnv(self.config, num_envs, num_threads)
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.single_action_space = action_space(self.core.task)
        self.single_observation_space = observation_space(self.core.task)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._done = np.zeros(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; an integer seed s gives environment i the seed s + i.

        The option "reset_mask", (num_envs,) of bool, resets only some; the other options are
        those of `FlyEnv.reset`, for every environment that is reset.
        """
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise ValueError(
                f"reset option 'reset_mask' must be {self.num_envs} bools; got {mask.dtype} of "
                f"shape {mask.shape}"
            )
        seeds: list[int | None]
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed has {len(seeds)} entries; there are {self.num_envs} envs")
        ids = np.flatnonzero(mask)
        episodes = [
            episode_with_options(self.core.draw_episode(int(i), seeds[i]), options) for i in ids
        ]
        observation = self.core.reset(ids=ids, episodes=episodes)
        self._done[ids] = False
        return observation, self._info(
            np.full(self.num_envs, "running"), np.zeros(self.num_envs, dtype=bool)
        )

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Hold one drive per fly for a decision interval."""
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            return self._step_next(actions)
        if self.autoreset_mode == AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError(
                f"environments {np.flatnonzero(self._done).tolist()} are done; reset them with "
                "the option 'reset_mask' before the next step"
            )
        transition = self.core.step(actions)
        info = self._info(transition.outcome, transition.is_success)
        observation = transition.observation
        if self.autoreset_mode == AutoresetMode.DISABLED:
            self._done = transition.done
        elif transition.done.any():
            ids = np.flatnonzero(transition.done)
            info["final_obs"] = _rows(observation, transition.done)
            info["final_info"] = {name: info[name].copy() for name in ("outcome", "is_success")}
            info["_final_obs"] = info["_final_info"] = transition.done.copy()
            observation = self.core.reset(ids=ids)
        return (
            observation,
            transition.reward,
            transition.terminated,
            transition.truncated,
            info,
        )

    def _step_next(
        self, actions: NDArray[np.float32]
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Reset the flies that were done, with a reward of 0, and step the others."""
        starting = self._done
        if not starting.any():
            transition = self.core.step(actions)
        else:
            moving = np.flatnonzero(~starting)
            self.core.reset(ids=np.flatnonzero(starting))
            transition = _mask(self.core.step(actions, ids=moving), starting)
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
        return {
            "outcome": outcome.astype(object),
            "_outcome": everyone,
            "is_success": is_success,
            "_is_success": everyone.copy(),
            "time_s": self.core.fly_state.time.copy(),
            "_time_s": everyone.copy(),
        }

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing is held open."""


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
