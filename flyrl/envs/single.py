"""One body as a Gymnasium environment."""

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from numpy.typing import NDArray

from flyrl.envs.config import Observation, config_for
from flyrl.envs.core import BatchedEnv
from flyrl.envs.options import action_space, action_vectors, episode_with_options, observation_space
from flyrl.envs.registration import limited_spec
from flyrl.envs.rendering import RENDERING, Drawn, View, check_render_mode
from flyrl.simulation.marks import PLAIN
from flyrl.simulation.randomisation import UNVARIED
from flyrl.simulation.rendering import Camera
from flyrl.tasks import RUNNING


class FlyrlEnv(gymnasium.Env[Any, Any]):
    """One fly, or one worm; the arguments are those of `EnvConfig`, and settings of the task.

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
    camera, overlay, width, height
        How pictures look: see `flyrl.envs.rendering.View`.
    """

    metadata: dict[str, Any] = RENDERING

    def __init__(
        self,
        render_mode: str | None = None,
        camera: Camera = "follow",
        overlay: Drawn = PLAIN,
        width: int = 640,
        height: int = 480,
        **config: Any,
    ) -> None:
        self.render_mode = check_render_mode(render_mode)
        self.config = config_for(type(self), config)
        view = View(camera, overlay, width, height)
        self.core = BatchedEnv(self.config, num_envs=1, num_threads=1, view=view)
        self.action_space = action_space(self.core.task)
        self.observation_space = observation_space(self.core.task)
        self._settings = {
            "render_mode": render_mode,
            **vars(view),
            **config,
        }
        self._spec: EnvSpec | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._settings), (), {"_spec": self._spec}

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made it from; `max_episode_steps` is the task's limit, in decisions."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = limited_spec(spec, self.core.max_decisions)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes by code, as in `info["outcome"]`."""
        return self.core.task.outcomes

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode: number `seed` if given, else the next of this environment's own."""
        episode = episode_with_options(self.core.draw_episode(0, seed), options)
        # the core draws from its own generator; this one is for users and wrappers
        if seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)
        observation = self.core.reset(episodes=[episode])
        return _first(observation), self._info(self.outcomes.index(RUNNING), is_success=False)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one decision interval."""
        one = (
            {name: np.asarray(values)[None] for name, values in action.items()}
            if isinstance(action, Mapping)
            else np.asarray(action)[None]
        )
        transition = self.core.step(action_vectors(self.core.task, one))
        return (
            _first(transition.observation),
            float(transition.reward[0]),
            bool(transition.terminated[0]),
            bool(transition.truncated[0]),
            self._info(int(transition.outcome_code[0]), bool(transition.is_success[0])),
        )

    def _info(self, outcome_code: int, is_success: bool) -> dict[str, Any]:
        info: dict[str, Any] = {
            "outcome": outcome_code,
            "is_success": is_success,
            "time_s": float(self.core.state.time[0]),
        }
        for key, values in self.core.failure_info().items():
            info[key] = values[0].item()
        if self.config.scene.terrain.random:
            info["ground"] = int(self.core.grounds()[0])
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
        return self.core.task.compute_reward(achieved_goal, desired_goal, info)

    def compute_terminated(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Whether an episode ends with goals (..., k) as observed and their `info`s."""
        return self.core.task.compute_terminated(achieved_goal, desired_goal, info)


def _first(observation: Observation) -> Any:
    if isinstance(observation, dict):
        return {name: values[0] for name, values in observation.items()}
    return observation[0]
