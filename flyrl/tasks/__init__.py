"""Decision problems: observation, reward, termination and reset of each task, as tables."""

from functools import cache
from typing import Final

from flyrl.bodies.worm import WORMS, WormConfig
from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW, Actions, Drives, JointTargets, Neurons
from flyrl.tasks.episode import Episode
from flyrl.tasks.extension import Term, extended, task_record, task_table, term_digests
from flyrl.tasks.failures import FAILURES
from flyrl.tasks.heading import HEADING
from flyrl.tasks.hybrid_turning import HYBRID_TURNING
from flyrl.tasks.joints import JOINTS, JOINTS_BOX
from flyrl.tasks.path import PATH
from flyrl.tasks.target import TARGET
from flyrl.tasks.target_goal import TARGET_GOAL
from flyrl.tasks.task import (
    ACHIEVED_GOAL,
    DECISIONS_LOST,
    DESIRED_GOAL,
    ERRORS,
    IS_FAILURE,
    OUTCOMES,
    RUNNING,
    SUCCESS,
    TIMEOUT,
    UNSTABLE,
    EpisodeSampler,
    EpisodeState,
    ErrorTerm,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
    WormTaskState,
)
from flyrl.tasks.traverse import TRAVERSE
from flyrl.tasks.velocity import VELOCITY
from flyrl.tasks.worm import WORM_TASKS
from flyrl.validation import one_of

TASKS: Final = {
    task.name: task
    for task in (
        TARGET,
        TARGET_GOAL,
        VELOCITY,
        PATH,
        TRAVERSE,
        HEADING,
        HYBRID_TURNING,
        JOINTS,
        JOINTS_BOX,
    )
}
"""Tasks for flies by name."""

TASK_NAMES: Final = (*TASKS, *WORM_TASKS)
"""Of all tasks, those for worms included."""


def task_named(name: str, worm: WormConfig | None = None) -> Task:
    """Task of a name; one for worms is made for the worm that is given, or for its usual one.

    Raises
    ------
    ValueError
        If there is no task of that name.
    """
    one_of("task", name, TASK_NAMES)
    if name in TASKS:
        return TASKS[name]
    return _made_to_measure(name, worm or WORMS[WORM_TASKS[name].body])


@cache  # so that the tasks of equal worms are equal
def _made_to_measure(name: str, worm: WormConfig) -> Task:
    return WORM_TASKS[name].task(name, worm)


__all__ = [
    "ACHIEVED_GOAL",
    "DECISIONS_LOST",
    "DESIRED_GOAL",
    "DRIVE_HIGH",
    "DRIVE_LOW",
    "ERRORS",
    "FAILURES",
    "IS_FAILURE",
    "OUTCOMES",
    "RUNNING",
    "SUCCESS",
    "TASKS",
    "TASK_NAMES",
    "TIMEOUT",
    "UNSTABLE",
    "WORM_TASKS",
    "Actions",
    "Drives",
    "Episode",
    "EpisodeSampler",
    "EpisodeState",
    "ErrorTerm",
    "JointTargets",
    "MeanTerm",
    "Neurons",
    "ObservationTerm",
    "RewardTerm",
    "Task",
    "TaskState",
    "Term",
    "Termination",
    "WormTaskState",
    "extended",
    "task_named",
    "task_record",
    "task_table",
    "term_digests",
]
