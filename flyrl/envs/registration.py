"""Gymnasium ids."""

from typing import Any, Final

import gymnasium
from gymnasium.envs.registration import EnvSpec

# Names alone, since this is imported with flyrl: the tasks themselves load MuJoCo and Numba.
_TASKS: Final = (
    "target",
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


def register_envs() -> None:
    """Register every id; a second call changes nothing."""
    for env_id, task in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            spec = own_spec(task, task in _GOAL_TASKS)
            gymnasium.register(
                id=env_id,
                entry_point=spec.entry_point,
                vector_entry_point=spec.vector_entry_point,
                kwargs=spec.kwargs,
            )


def own_spec(task: Any, has_goals: bool) -> EnvSpec:
    """What Gymnasium makes a task of one's own from, of which it has no id."""
    return EnvSpec(
        id="flyrl/Task-v0",
        entry_point=f"flyrl.envs.gym:{'FlyrlGoalEnv' if has_goals else 'FlyrlEnv'}",
        vector_entry_point="flyrl.envs.gym:FlyrlVectorEnv",
        kwargs={"task": task},
    )
