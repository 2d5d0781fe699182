"""One body, or many over the native batch, as environments of Gymnasium."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flyrl.envs.adapter import Adapter, episode_with_options, row_of
from flyrl.envs.bodies import RENDERING
from flyrl.envs.config import Observation
from flyrl.simulation.randomisation import UNVARIED
from flyrl.tasks import RUNNING, Episode
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

    A copy, deep or by pickle, is made anew from the settings, and must be reset.

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
        episode = episode_with_options(self.core.draw_episode(0, seed), options)
        # the core draws from its own generator; this one is for users and wrappers
        if seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)
        observation = self.core.reset(episodes=[episode])
        return row_of(observation, 0), self._info([self.outcomes.index(RUNNING)], [False])

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one decision interval."""
        transition = self.core.step(action_vectors(action)[None])
        return (
            row_of(transition.observation, 0),
            float(transition.reward[0]),
            bool(transition.terminated[0]),
            bool(transition.truncated[0]),
            self._info(transition.outcome_code, transition.is_success),
        )

    def _info(self, outcome_code: Any, is_success: Any) -> dict[str, Any]:
        facts = self._facts(outcome_code, is_success)
        info = {key: np.asarray(values)[0].item() for key, values in facts.items()}
        (episode,) = self.core.episodes
        if episode is not None and episode.randomisation != UNVARIED:
            info["randomisation"] = episode.randomisation.numbers()
        return info

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
        self._elapsed_steps = np.zeros(num_envs, dtype=np.int64)
        self._is_varied = np.zeros(num_envs, dtype=bool)
        self._drawn = {
            name: np.zeros(num_envs, type(usual)) for name, usual in UNVARIED.numbers().items()
        }
        self._running = self.outcomes.index(RUNNING)

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
        running = np.full(self.num_envs, self._running)
        return observation, self._info(running, np.zeros(self.num_envs, dtype=bool))

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
            self._start(np.flatnonzero(starting))
            moving = np.flatnonzero(~starting)
        result = self.core.step(action_vectors(actions), moving)
        observation, reward, terminated = result.observation, result.reward, result.terminated
        truncated, outcome_code, is_success = (
            result.truncated,
            result.outcome_code,
            result.is_success,
        )
        if self._max_episode_steps is not None:
            self._elapsed_steps[~starting] += 1
            truncated |= self._elapsed_steps >= self._max_episode_steps
        if moving is not None:
            outcome_code[starting] = self._running
            for values in (reward, terminated, truncated, is_success):
                values[starting] = 0
        done, final = result.done, {}
        if self.autoreset_mode != AutoresetMode.SAME_STEP:
            self._done = done
        elif done.any():
            final = {
                "final_obs": _rows(observation, done),
                "final_info": self._info(outcome_code, is_success, done),
                "_final_obs": done,
                "_final_info": done.copy(),
            }
            observation = self._start(np.flatnonzero(done))
            outcome_code[done] = self._running
            is_success[done] = False
        info = self._info(outcome_code, is_success) | final
        return observation, reward, terminated, truncated, info

    def _start(
        self, ids: NDArray[np.intp], episodes: Sequence[Episode] | None = None
    ) -> Observation:
        """Start episodes, the given ones or those drawn next."""
        observation = self.core.reset(ids=ids, episodes=episodes)
        self._elapsed_steps[ids] = 0
        for i in ids:
            if (episode := self.core.episodes[i]) is not None:
                self._is_varied[i] = episode.randomisation != UNVARIED
                for name, value in episode.randomisation.numbers().items():
                    self._drawn[name][i] = value
        return observation

    def _info(
        self,
        outcome_code: NDArray[np.int64],
        is_success: NDArray[np.bool_],
        mask: NDArray[np.bool_] | bool = True,
    ) -> dict[str, Any]:
        """What single environments have in `info`, with masks as SyncVectorEnv makes them."""
        info = _only(self._facts(outcome_code, is_success), np.full(self.num_envs, mask))
        is_varied = self._is_varied & mask
        if is_varied.any():
            info |= _only({"randomisation": self._drawn}, is_varied)
        return info

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
