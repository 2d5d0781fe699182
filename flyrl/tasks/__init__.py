"""Decision problems: observation, reward, termination and reset of each task, as tables."""

from typing import Final

from flyrl.tasks.episode import Episode
from flyrl.tasks.hybrid_turning import HYBRID_TURNING
from flyrl.tasks.target import TARGET
from flyrl.tasks.task import (
    DRIVE_HIGH,
    DRIVE_LOW,
    RUNNING,
    TIMEOUT,
    UNSTABLE,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
)

TASKS: Final = {task.name: task for task in (TARGET, HYBRID_TURNING)}

__all__ = [
    "DRIVE_HIGH",
    "DRIVE_LOW",
    "RUNNING",
    "TASKS",
    "TIMEOUT",
    "UNSTABLE",
    "Episode",
    "ObservationTerm",
    "RewardTerm",
    "Task",
    "TaskState",
    "Termination",
]
