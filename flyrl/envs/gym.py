"""One body, or many over the native batch, as environments of Gymnasium."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flyrl.envs.adapter import Adapter, row_of
from flyrl.envs.bodies import RENDERING
from flyrl.envs.config import Observation
from flyrl.tasks import RUNNING
from flyrl.tasks.actions import action_vectors
from flyrl.tasks.target import compute_reward, compute_terminated
from flyrl.validation import random_seed, whole_number


class FlyrlEnv(Adapter, gymnasium.Env[Any, Any]):
    """One fly, or one worm, as a Gymnasium environment.

    `reset` takes the options "init_phases" and "init_magnitudes" (six numbers each, ordered as
    anatomy.LEGS), "spawn_position" (x, y, z in mm), "spawn_yaw" (rad), "goal" (the target's x and
    y in mm), "command" and "pushes" (as many numbers as the task's, see docs/tasks.md),
    "randomisation" (values by name, see `Randomisation`), on random terrain "ground" (a seed), and
    of a worm "joint_angles" (rad, head to tail), which replace what the seed draws, or "episode",
    which replaces all of it.
    `info` holds numbers, under the same keys after a reset and a step: "outcome" (a code, whose
    name is `outcomes[code]`), "is_success" and "time_s"; on random terrain also "ground"; with a
    body other than the scene's own "randomisation" (see `Randomisation.numbers`); and in a task
    with goals "is_failure" and "decisions_lost" (how many before the time limit the failure cut
    off; 0 without one).

    A copy, deep or by pickle, is a new one of the same settings, and must be reset.

    Parameters
    ----------
    render_mode
        None or "rgb_array".
    **settings
        Fields of `EnvConfig` and of `flyrl.envs.bodies.View`, and settings of the task.

    Raises
    ------
    ValueError
        An argument that is not allowed.
    """

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        self._make_core({"render_mode": render_mode}, settings)
        self.action_space = self.core.task.actions.space
        self.observation_space = self.core.task.observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode: number `seed` if given, else the next of this environment's own."""
        observation = self._reset([seed], [options])
        super().reset(seed=seed)  # the core draws from its own generator, users from this one
        return row_of(observation, 0), _first(self._info())

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one decision interval."""
        transition = self.core.step(action_vectors(action)[None])
        return (
            row_of(transition.observation, 0),
            float(transition.reward[0]),
            bool(transition.terminated[0]),
            bool(transition.truncated[0]),
            _first(self._info(transition.outcome_code, transition.is_success)),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Picture of the body, (height, width, 3), or None without a render mode."""
        return None if self.render_mode is None else self.core.render()

    def close(self) -> None:
        """Free the renderer; to reset, step or render from now on is an error."""
        self.core.close()


class FlyrlGoalEnv(FlyrlEnv):
    """One fly in a task with goals; SB3 takes for a GoalEnv whatever has `compute_reward`."""

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Reward for goals (..., k) as observed and their `info`s, as a GoalEnv has it."""
        return compute_reward(self.core.task, achieved_goal, desired_goal, info)

    def compute_terminated(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Whether an episode ends with goals (..., k) as observed and their `info`s."""
        return compute_terminated(self.core.task, achieved_goal, desired_goal, info)


class FlyrlVectorEnv(Adapter, VectorEnv[Any, NDArray[Any], NDArray[Any]]):
    """`num_envs` flies or worms on native threads, as a Gymnasium vector environment.

    `gymnasium.make_vec` makes one. Environment i gives the same bits as the single environment
    with its seed. A copy, deep or by pickle, is a new one of the same settings, and must be reset.

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
    **settings
        Fields of `EnvConfig` and of `flyrl.envs.bodies.View`, and settings of the task.

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
        **settings: Any,
    ) -> None:
        if max_episode_steps is not None:
            whole_number("max_episode_steps", max_episode_steps, 1, 2**31)
        own: dict[str, Any] = {"num_envs": num_envs, "num_threads": num_threads}
        own |= {"autoreset_mode": autoreset_mode, "max_episode_steps": max_episode_steps}
        self._make_core({**own, "render_mode": render_mode}, settings)
        num_envs = self.num_envs = self.core.num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**RENDERING, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = self.core.task.actions.space
        self.single_observation_space = self.core.task.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._done = np.zeros(num_envs, dtype=bool)
        self._max_episode_steps = max_episode_steps

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
        seeds: list[int | None] = [None] * self.num_envs
        if isinstance(seed, Sequence | np.ndarray):
            seeds = list(seed)
        elif seed is not None:
            seeds = [random_seed(seed) + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed has {len(seeds)} entries; there are {self.num_envs} envs")
        ids = np.flatnonzero(mask)
        observation = self._reset([seeds[i] for i in ids], [options] * len(ids), ids)
        self._done[ids] = False
        return observation, self._info()

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Hold one action per body for a decision interval.

        With NEXT_STEP, bodies that were done are reset instead, with a reward of 0.
        """
        starting, moving = self._done, None
        if starting.any():
            if self.autoreset_mode == AutoresetMode.DISABLED:
                raise RuntimeError(
                    f"environments {np.flatnonzero(starting).tolist()} are done; reset them with "
                    "the option 'reset_mask' before the next step"
                )
            self.core.reset(ids=np.flatnonzero(starting))
            moving = np.flatnonzero(~starting)
        result = self.core.step(action_vectors(actions), moving)
        observation, running = result.observation, self.outcomes.index(RUNNING)
        reward, terminated, truncated = result.reward, result.terminated, result.truncated
        if self._max_episode_steps is not None:
            decisions = np.round(self.core.state.time / self.config.decision_interval_s)
            truncated |= decisions >= self._max_episode_steps
        for values in (reward, terminated, truncated, result.is_success):
            values[starting] = 0
        result.outcome_code[starting] = running
        done, final = result.done, {}
        if self.autoreset_mode != AutoresetMode.SAME_STEP:
            self._done = done
        elif done.any():
            final = {
                "final_obs": _rows(observation, done),
                "final_info": self._info(result.outcome_code, result.is_success, done),
                "_final_obs": done,
                "_final_info": done.copy(),
            }
            observation = self.core.reset(ids=np.flatnonzero(done))
            result.outcome_code[done] = running
            result.is_success[done] = False
        info = self._info(result.outcome_code, result.is_success) | final
        return observation, reward, terminated, truncated, info

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
        rows[i] = row_of(observation, i)
    return rows


def _first(info: Mapping[str, Any]) -> dict[str, Any]:
    """`info` of the only environment."""
    return {
        key: _first(values) if isinstance(values, Mapping) else values[0].item()
        for key, values in info.items()
        if not key.startswith("_")
    }
