"""Decision problems: observation, reward, termination and reset of each task, as tables."""

from typing import Final

from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW, Actions, Drives, Neurons
from flyrl.tasks.episode import Episode
from flyrl.tasks.extension import Term, extended, task_record, term_digests
from flyrl.tasks.failures import FAILURES
from flyrl.tasks.heading import HEADING
from flyrl.tasks.hybrid_turning import HYBRID_TURNING
from flyrl.tasks.path import PATH
from flyrl.tasks.target import TARGET
from flyrl.tasks.target_goal import TARGET_GOAL
from flyrl.tasks.task import (
    ACHIEVED_GOAL,
    DECISIONS_LOST,
    DESIRED_GOAL,
    ERRORS,
    IS_FAILURE,
    RUNNING,
    SUCCESS,
    TIMEOUT,
    UNSTABLE,
    EpisodeSampler,
    ErrorTerm,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
)
from flyrl.tasks.traverse import TRAVERSE
from flyrl.tasks.velocity import VELOCITY

TASKS: Final = {
    task.name: task
    for task in (TARGET, TARGET_GOAL, VELOCITY, PATH, TRAVERSE, HEADING, HYBRID_TURNING)
}

__all__ = [
    "ACHIEVED_GOAL",
    "DECISIONS_LOST",
    "DESIRED_GOAL",
    "DRIVE_HIGH",
    "DRIVE_LOW",
    "ERRORS",
    "FAILURES",
    "IS_FAILURE",
    "RUNNING",
    "SUCCESS",
    "TASKS",
    "TIMEOUT",
    "UNSTABLE",
    "Actions",
    "Drives",
    "Episode",
    "EpisodeSampler",
    "ErrorTerm",
    "MeanTerm",
    "Neurons",
    "ObservationTerm",
    "RewardTerm",
    "Task",
    "TaskState",
    "Term",
    "Termination",
    "extended",
    "task_record",
    "term_digests",
]
