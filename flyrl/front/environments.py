"""Environments by the name of their task, and by their ids in Gymnasium."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import gymnasium
from gymnasium.envs.registration import EnvSpec

if TYPE_CHECKING:
    from flyrl.envs.sb3 import FlyrlVecEnv
    from flyrl.tasks import Task, TaskSettings

# Names alone, since this is imported with flyrl: the tasks themselves load MuJoCo and Numba.
_TASKS: Final = (
    "target",
    "target_unfiltered",
    "velocity",
    "path",
    "traverse",
    "heading",
    "slalom",
    "chase",
    "stop",
    "hybrid_turning",
    "joints",
    "joints_box",
    "worm_hang",
    "worm_hang_box",
    "worm_crawl",
    "worm_crawl_box",
)
_GOAL_TASKS: Final = ("target_goal",)

ENV_IDS: Final = {
    f"flyrl/{''.join(part.capitalize() for part in name.split('_'))}-v0": name
    for name in (*_TASKS, *_GOAL_TASKS)
}
"""Gymnasium id -> task."""


def make(task: TaskSettings | Task, **settings: Any) -> gymnasium.Env[Any, Any]:
    """Make a Gymnasium environment of a task, as `gymnasium.make` does by its id.

    Parameters
    ----------
    task
        As `EnvConfig` takes it: a name, e.g. "target", or module:function of your own, a task
        function, a table, or a mapping.
    settings
        Arguments of `EnvConfig` and of `FlyrlEnv`, settings of the task, e.g. distance=(3, 30), and
        arguments of `gymnasium.make`.

    Raises
    ------
    ValueError
        There is no such task, setting or value.
    """
    return gymnasium.make(_spec(task), **settings)


def make_vec(
    task: TaskSettings | Task, num_envs: int = 1, **settings: Any
) -> gymnasium.vector.VectorEnv:
    """Make a Gymnasium vector environment of a task; arguments and errors as in `make`."""
    return gymnasium.make_vec(_spec(task), num_envs=num_envs, **settings)


def make_sb3(task: TaskSettings | Task, num_envs: int = 1, **settings: Any) -> FlyrlVecEnv:
    """Make a Stable-Baselines3 VecEnv of a task.

    Parameters
    ----------
    task
        As in `make`.
    num_envs
        Number of flies.
    settings
        Arguments of `EnvConfig`, settings of the task, and arguments of `FlyrlVecEnv`.

    Raises
    ------
    ValueError
        There is no such task, setting or value.
    """
    from flyrl.envs.sb3 import FlyrlVecEnv  # noqa: PLC0415  (takes torch)

    return FlyrlVecEnv(None, num_envs, task=task, **settings)


def register_envs() -> None:
    """Register every id; a second call changes nothing."""
    for env_id, task in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(env_id, **_registered(task, task in _GOAL_TASKS))


def _registered(task: Any, has_goals: bool) -> dict[str, Any]:
    """Arguments of `gymnasium.register` for a task."""
    return {
        "entry_point": f"flyrl.envs.gym:{'FlyrlGoalEnv' if has_goals else 'FlyrlEnv'}",
        "vector_entry_point": "flyrl.envs.gym:FlyrlVectorEnv",
        "kwargs": {"task": task},
    }


def _spec(task: TaskSettings | Task) -> str | EnvSpec:
    """Id of a built-in task, or what Gymnasium makes another one from."""
    from flyrl.tasks import Task, task_from  # noqa: PLC0415  (loads MuJoCo)

    ids = {name: env_id for env_id, name in ENV_IDS.items()}
    if isinstance(task, str) and task in ids:
        return ids[task]
    has_goals = (task if isinstance(task, Task) else task_from(task)).has_goals
    return EnvSpec("flyrl/Task-v0", **_registered(task, has_goals))
