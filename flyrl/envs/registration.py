"""Gymnasium ids."""

from typing import Final

import gymnasium

from flyrl.tasks import TASK_NAMES, TASKS

ENV_IDS: Final = {
    f"flyrl/{''.join(part.capitalize() for part in name.split('_'))}-v0": name
    for name in TASK_NAMES
}
"""Gymnasium id -> task."""


def register_envs() -> None:
    """Register every id; a second call changes nothing."""
    for env_id, task in ENV_IDS.items():
        if env_id not in gymnasium.registry:
            has_goals = task in TASKS and TASKS[task].has_goals
            env_class = "FlyrlGoalEnv" if has_goals else "FlyrlEnv"
            gymnasium.register(
                id=env_id,
                entry_point=f"flyrl.envs.single:{env_class}",
                vector_entry_point="flyrl.envs.vector:FlyrlVectorEnv",
                kwargs={"task": task},
            )
