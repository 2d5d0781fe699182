"""Target with goals: the task `target` as Gymnasium's GoalEnv, for hindsight experience replay.

Goals are places in the world frame, in units of GOAL_UNIT, so that any place where the fly has been
could have been its goal. The heading is observed beside them: with it, a policy can tell where the
goal lies from the fly.

Every decision costs the same until the goal is reached, and nothing else ends an episode early:
were a fall to end it, falling would save what the rest of the time costs. A fly that fell or left
the arena goes on from where it is.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from flyrl.tasks import terms
from flyrl.tasks.senses import SENSES
from flyrl.tasks.target import TARGET, sample_episode
from flyrl.tasks.task import (
    ACHIEVED_GOAL,
    DESIRED_GOAL,
    SUCCESS,
    Array,
    Mask,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
)

GOAL_UNIT: Final = 10.0
"""mm."""

_BOUND: Final = 10.0
"""Of a goal's coordinates, in GOAL_UNIT: the edge of flat ground, the widest of all."""


def _place(state: TaskState) -> Array:
    return state.fly.position_w[:, :2] / GOAL_UNIT


def _goal(state: TaskState) -> Array:
    return state.goal / GOAL_UNIT


ACHIEVED: Final = ObservationTerm(
    ACHIEVED_GOAL, (2,), -_BOUND, _BOUND, _place, "x and y of the thorax, in 10 mm (world frame)"
)
DESIRED: Final = ObservationTerm(
    DESIRED_GOAL, (2,), -_BOUND, _BOUND, _goal, "x and y of the target, in 10 mm (world frame)"
)


def distance(achieved_goal: ArrayLike, desired_goal: ArrayLike) -> Array:
    """Distance between goals (..., 2), mm, (...)."""
    offset = np.asarray(desired_goal, np.float64) - np.asarray(achieved_goal, np.float64)
    return np.asarray(GOAL_UNIT * np.hypot(offset[..., 0], offset[..., 1]))


def is_reached(achieved_goal: ArrayLike, desired_goal: ArrayLike) -> Mask:
    """Whether goals (..., 2) lie within REACH of each other, (...)."""
    return np.asarray(distance(achieved_goal, desired_goal) < terms.REACH)


def is_away(achieved_goal: ArrayLike, desired_goal: ArrayLike) -> Array:
    """1 where goals (..., 2) do not lie within REACH of each other, else 0, (...)."""
    return np.asarray(~is_reached(achieved_goal, desired_goal), dtype=np.float64)


def _goals(state: TaskState) -> tuple[ArrayLike, ArrayLike]:
    """Achieved and desired goals as they are observed."""
    return ACHIEVED.shown(_place(state)), DESIRED.shown(_goal(state))


def at_goal(state: TaskState) -> Mask:
    """Whether the goal is reached, as the goals are observed, (n,)."""
    return is_reached(*_goals(state))


def away(state: TaskState) -> Array:
    """1 where the goal is not reached, as the goals are observed, (n,)."""
    return is_away(*_goals(state))


def goal_distance(state: TaskState) -> Array:
    """Distance to the goal, as the goals are observed, mm, (n,)."""
    return distance(*_goals(state))


TARGET_GOAL: Final = Task(
    name="target_goal",
    observation=(
        ACHIEVED,
        DESIRED,
        ObservationTerm(
            "compass", (2,), -1.0, 1.0, terms.compass, "cos and sin of the heading from +x"
        ),
        *SENSES,
    ),
    is_flat=False,
    reward=(
        RewardTerm("away", -1.0, away, "1 where the target is not reached", is_away),
        RewardTerm("distance", 0.0, goal_distance, "mm to the target", distance),
    ),
    terminations=(Termination(SUCCESS, at_goal),),
    time_limit_s=TARGET.time_limit_s,
    decision_interval_s=TARGET.decision_interval_s,
    action_low=TARGET.action_low,
    action_high=TARGET.action_high,
    sample_episode=sample_episode,
    difficulty=TARGET.difficulty,
    is_reached=is_reached,
)  # fmt: skip
