"""Target with goals: the task `target` as Gymnasium's GoalEnv, for hindsight experience replay.

Goals are places in the world frame, in units of GOAL_UNIT, so that any place where the fly has been
could have been its goal. The heading is observed beside them: with it, a policy can tell where the
goal lies from the fly.

Every decision costs the same until the goal is reached. A failure ends the episode too, and costs
what the decisions that it cuts off would have cost the fly where it is, so that it saves nothing.
That holds wherever the goal is: of a decision that reaches its goal and fails, the rest is charged
all the same. Hindsight would otherwise make successes of failures, since the place where a fly
failed is the goal that its last decision is replayed with.
"""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from flyrl.tasks import terms
from flyrl.tasks.function import variant_of
from flyrl.tasks.senses import SENSES
from flyrl.tasks.target import target
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
from flyrl.tasks.terms import FAILURES, decisions_lost

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


def is_reached(achieved_goal: ArrayLike, desired_goal: ArrayLike, reach: float) -> Mask:
    """Whether goals (..., 2) lie within `reach`, mm, of each other, (...)."""
    return np.asarray(distance(achieved_goal, desired_goal) < reach)


def is_away(
    achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike, reach: float
) -> Array:
    """1 where goals (..., 2) do not lie within `reach`, mm, of each other, else 0, (...)."""
    return np.asarray(~is_reached(achieved_goal, desired_goal, reach), dtype=np.float64)


def distances(achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike) -> Array:
    """Distance between goals (..., 2), mm, for this decision and each that is lost, (...)."""
    return np.asarray(distance(achieved_goal, desired_goal) * (1.0 + np.asarray(lost)))


def is_lost(achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike) -> Array:
    """Decisions that are lost, whatever the goals, (...)."""
    return np.asarray(lost, dtype=np.float64)


def _goals(state: TaskState) -> tuple[ArrayLike, ArrayLike]:
    """Achieved and desired goals as they are observed."""
    return ACHIEVED.shown(_place(state)), DESIRED.shown(_goal(state))


def at_goal(state: TaskState, reach: float) -> Mask:
    """Whether the goal is reached, as the goals are observed, (n,)."""
    return is_reached(*_goals(state), reach)


def away(state: TaskState, reach: float) -> Array:
    """1 where the goal is not reached, as the goals are observed, (n,)."""
    return is_away(*_goals(state), 0.0, reach)


def goal_distances(state: TaskState) -> Array:
    """Distance to the goal as observed, mm, for this decision and each that is lost, (n,)."""
    return distances(*_goals(state), decisions_lost(state))


@variant_of(target)
def target_goal(task: Task) -> Task:
    """Steer to a target, with goals that can be swapped afterwards."""
    reach = task.parameters["reach"]
    return replace(
        task,
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
            RewardTerm(
                "away", -1.0, partial(away, reach=reach), "1 where the target is not reached",
                partial(is_away, reach=reach),
            ),
            RewardTerm(
                "distance", 0.0, goal_distances,
                "mm to the target, for this decision and each that a failure cuts off", distances,
            ),
            # no failure may save the decisions that it cuts off
            RewardTerm(
                "lost_time", -1.0, decisions_lost, "decisions left when the fly fails", is_lost
            ),
        ),
        terminations=(Termination(SUCCESS, partial(at_goal, reach=reach)), *FAILURES),
        is_reached=partial(is_reached, reach=reach),
    )  # fmt: skip
