"""Environments by the name of their task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from flyrl.envs.registration import ENV_IDS, own_spec
from flyrl.tasks import Task, TaskSettings, task_from

if TYPE_CHECKING:
    from flyrl.envs.sb3 import FlyrlVecEnv


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


def _spec(task: TaskSettings | Task) -> str | EnvSpec:
    """Id of a built-in task, or what Gymnasium makes another one from."""
    ids = {name: env_id for env_id, name in ENV_IDS.items()}
    if isinstance(task, str) and task in ids:
        return ids[task]
    has_goals = (task if isinstance(task, Task) else task_from(task)).has_goals
    return own_spec(task, has_goals)
