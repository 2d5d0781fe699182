"""How a fly fails, whatever its task: the rows that every table shares."""

from typing import Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.task import Array, RewardTerm, TaskState, Termination

FAILURES: Final = (
    Termination("fall", terms.has_fallen),
    Termination("left_arena", terms.has_left),
)


def time_lost(state: TaskState) -> Array:
    """Time left, s, where the fly failed or its physics blew up, else 0, (n,)."""
    is_lost = state.fly.is_unstable.copy()
    for failure in FAILURES:
        is_lost |= failure.holds(state)
    return np.where(is_lost, state.remaining_s, 0.0)


def lost_time(weight: float) -> RewardTerm:
    """Row of a reward table: a failure costs what the time that it cuts off could have cost."""
    return RewardTerm("lost_time", weight, time_lost, "s left when the fly fails")
