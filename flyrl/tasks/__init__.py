"""Decision problems: observation, reward, termination and reset of each task, as tables."""

from flyrl.tasks import (
    chase,
    heading,
    hybrid_turning,
    path,
    slalom,
    stop,
    target,
    traverse,
    velocity,
    worm,
)
from flyrl.tasks.actions import DRIVE_HIGH as DRIVE_HIGH
from flyrl.tasks.actions import DRIVE_LOW as DRIVE_LOW
from flyrl.tasks.actions import Drives as Drives
from flyrl.tasks.actions import JointTargets as JointTargets
from flyrl.tasks.actions import Neurons as Neurons
from flyrl.tasks.episode import Episode as Episode
from flyrl.tasks.extension import code_digests as code_digests
from flyrl.tasks.extension import code_of as code_of
from flyrl.tasks.extension import extended as extended
from flyrl.tasks.extension import load_terms as load_terms
from flyrl.tasks.extension import task_record as task_record
from flyrl.tasks.extension import task_table as task_table
from flyrl.tasks.function import TASKS as TASKS
from flyrl.tasks.function import TaskFunction as TaskFunction
from flyrl.tasks.function import TaskSettings as TaskSettings
from flyrl.tasks.function import task_from as task_from
from flyrl.tasks.function import with_time_limit as with_time_limit
from flyrl.tasks.task import ACHIEVED_GOAL as ACHIEVED_GOAL
from flyrl.tasks.task import DECISIONS_LOST as DECISIONS_LOST
from flyrl.tasks.task import DESIRED_GOAL as DESIRED_GOAL
from flyrl.tasks.task import IS_FAILURE as IS_FAILURE
from flyrl.tasks.task import OUTCOMES as OUTCOMES
from flyrl.tasks.task import RUNNING as RUNNING
from flyrl.tasks.task import SUCCESS as SUCCESS
from flyrl.tasks.task import TIMEOUT as TIMEOUT
from flyrl.tasks.task import UNSTABLE as UNSTABLE
from flyrl.tasks.task import EpisodeSampler as EpisodeSampler
from flyrl.tasks.task import ErrorTerm as ErrorTerm
from flyrl.tasks.task import MeanTerm as MeanTerm
from flyrl.tasks.task import ObservationTerm as ObservationTerm
from flyrl.tasks.task import RewardTerm as RewardTerm
from flyrl.tasks.task import Task as Task
from flyrl.tasks.task import TaskState as TaskState
from flyrl.tasks.task import Termination as Termination
from flyrl.tasks.terms import ERRORS as ERRORS
from flyrl.tasks.terms import FAILURES as FAILURES

for _module in (
    target, velocity, path, traverse, heading, slalom, chase, stop, hybrid_turning, worm
):  # fmt: skip
    TASKS.update(
        (name, task) for name, task in vars(_module).items() if isinstance(task, TaskFunction)
    )
