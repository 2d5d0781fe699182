"""One body as a Gymnasium environment."""

from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from flyrl.envs.adapter import Adapter, action_vectors, episode_with_options, row_of
from flyrl.simulation.randomisation import UNVARIED
from flyrl.tasks import RUNNING
from flyrl.tasks.target import compute_reward, compute_terminated


class FlyrlEnv(Adapter, gymnasium.Env[Any, Any]):
    """One fly, or one worm, as a Gymnasium environment.

    `reset` takes the options "init_phases" and "init_magnitudes" (six numbers each, ordered as
    anatomy.LEGS), "spawn_position" (x, y, z in mm), "spawn_yaw" (rad), "goal" (the target's x and
    y in mm), "command" and "pushes" (as many numbers as the task's, see docs/tasks.md),
    "randomisation" (numbers by name, see `Randomisation`), on random terrain "ground" (a seed), and
    of a worm "joint_angles" (rad, head to tail), which replace what the seed draws, or "episode",
    which replaces all of it.
    `info` holds numbers, under the same keys after a reset and a step: "outcome" (a code, whose
    name is `outcomes[code]`), "is_success" and "time_s"; on random terrain also "ground"; with a
    body other than the scene's own "randomisation"; and in a task with goals "is_failure" and
    "decisions_lost" (how many before the time limit the failure cut off; 0 without one).

    A copy, deep or by pickle, is made anew from the settings, and must be reset.

    Parameters
    ----------
    render_mode
        None or "rgb_array".
    **settings
        Fields of `EnvConfig` and of `flyrl.envs.rendering.View`, and settings of the task.

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
            info["randomisation"] = asdict(episode.randomisation)
        return info

    def render(self) -> NDArray[np.uint8] | None:
        """Picture of the body, (height, width, 3), or None without a render mode."""
        return None if self.render_mode is None else self.core.render()

    def close(self) -> None:
        """Free the renderer; to reset, step or render from now on is an error."""
        self.core.close()


class FlyrlGoalEnv(FlyrlEnv):
    """One fly in a task with goals: a GoalEnv, as Gymnasium-Robotics and SB3 know it."""

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Reward for goals (..., k) as observed and their `info`s, as in Gymnasium's GoalEnv."""
        return compute_reward(self.core.task, achieved_goal, desired_goal, info)

    def compute_terminated(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Whether an episode ends with goals (..., k) as observed and their `info`s."""
        return compute_terminated(self.core.task, achieved_goal, desired_goal, info)
