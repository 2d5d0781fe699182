"""Decision problems: observation, reward, termination and reset of each task, as tables."""

from flyrl.tasks import heading, hybrid_turning, path, slalom, target, traverse, velocity, worm
from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW, Drives, JointTargets, Neurons
from flyrl.tasks.episode import Episode
from flyrl.tasks.extension import (
    code_digests,
    code_of,
    extended,
    load_terms,
    task_record,
    task_table,
)
from flyrl.tasks.function import TASKS, TaskFunction, TaskSettings, task_from
from flyrl.tasks.task import (
    ACHIEVED_GOAL,
    DECISIONS_LOST,
    DESIRED_GOAL,
    IS_FAILURE,
    OUTCOMES,
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
from flyrl.tasks.terms import ERRORS, FAILURES

TASKS.update(
    target=target.target,
    target_goal=target.target_goal,
    velocity=velocity.velocity,
    path=path.path,
    traverse=traverse.traverse,
    heading=heading.heading,
    slalom=slalom.slalom,
    hybrid_turning=hybrid_turning.hybrid_turning,
    joints=hybrid_turning.joints,
    joints_box=hybrid_turning.joints_box,
    worm_hang=worm.worm_hang,
    worm_hang_box=worm.worm_hang_box,
    worm_crawl=worm.worm_crawl,
    worm_crawl_box=worm.worm_crawl_box,
)

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
    "TIMEOUT",
    "UNSTABLE",
    "Drives",
    "Episode",
    "EpisodeSampler",
    "ErrorTerm",
    "JointTargets",
    "MeanTerm",
    "Neurons",
    "ObservationTerm",
    "RewardTerm",
    "Task",
    "TaskFunction",
    "TaskSettings",
    "TaskState",
    "Termination",
    "code_digests",
    "code_of",
    "extended",
    "load_terms",
    "task_from",
    "task_record",
    "task_table",
]
