"""Environments by the name of their task."""

from __future__ import annotations

from typing import Any

import gymnasium

from flyrl.envs.registration import ENV_IDS
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.validation import one_of


def make(task: str, **settings: Any) -> gymnasium.Env[Any, Any]:
    """Make a Gymnasium environment of a task, as `gymnasium.make` does by its id.

    Parameters
    ----------
    task
        Name of the task, e.g. "target".
    settings
        Arguments of `EnvConfig`, of `FlyrlEnv`, and of `gymnasium.make`.

    Raises
    ------
    ValueError
        There is no such task, setting or value.
    """
    return gymnasium.make(_env_id(task), **settings)


def make_vec(task: str, num_envs: int = 1, **settings: Any) -> gymnasium.vector.VectorEnv:
    """Make a Gymnasium vector environment of a task; arguments and errors as in `make`."""
    return gymnasium.make_vec(_env_id(task), num_envs=num_envs, **settings)


def make_sb3(task: str, num_envs: int = 1, **settings: Any) -> FlyrlVecEnv:
    """Make a Stable-Baselines3 VecEnv of a task.

    Parameters
    ----------
    task
        Name of the task.
    num_envs
        Number of flies.
    settings
        Arguments of `EnvConfig` and of `FlyrlVecEnv`.

    Raises
    ------
    ValueError
        There is no such task, setting or value.
    """
    return FlyrlVecEnv(None, num_envs, task=task, **settings)


def _env_id(task: str) -> str:
    ids = {name: env_id for env_id, name in ENV_IDS.items()}
    return ids[one_of("task", task, ids)]
