"""How a fly fails, whatever its task: the rows that every table shares."""

from typing import Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.task import (
    DECISIONS_LOST,
    FALL,
    IS_FAILURE,
    LEFT_ARENA,
    Array,
    Mask,
    RewardTerm,
    TaskState,
    Termination,
)

FAILURES: Final = (
    Termination(FALL, terms.has_fallen),
    Termination(LEFT_ARENA, terms.has_left),
)


def has_failed(state: TaskState) -> Mask:
    """Whether the fly failed or its physics blew up, (n,)."""
    is_failure = state.fly.is_unstable.copy()
    for failure in FAILURES:
        is_failure |= failure.holds(state)
    return is_failure


def decisions_lost(state: TaskState) -> Array:
    """Decisions left where the fly failed, else 0, (n,)."""
    return np.where(has_failed(state), state.decisions_left, 0.0)


def time_lost(state: TaskState) -> Array:
    """Time left, s, where the fly failed, else 0, (n,)."""
    return np.where(has_failed(state), state.remaining_s, 0.0)


def failure_info(state: TaskState) -> dict[str, Array | Mask]:
    """What replay with other goals must know of a decision besides its goals, (n,) by key."""
    return {IS_FAILURE: has_failed(state), DECISIONS_LOST: decisions_lost(state)}


def lost_time(weight: float) -> RewardTerm:
    """Row of a reward table: a failure costs what the time that it cuts off could have cost."""
    return RewardTerm("lost_time", weight, time_lost, "s left when the fly fails")
