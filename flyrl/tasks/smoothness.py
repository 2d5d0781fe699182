"""Costs of steering that every steering task can weigh: jerky drives, and the work of the legs."""

from typing import Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.task import Array, RewardTerm, TaskState


def drive_change(state: TaskState) -> Array:
    """By how much the drive changed with this decision, summed over both sides, (n,)."""
    change: Array = np.abs(state.body.actuation - state.previous.actuation).sum(axis=1)
    return change


def joint_work(state: TaskState) -> Array:
    """Positive work of the 42 joints' servos in a decision, by torques and velocities at its end.

    nJ (µN·mm), (n,).
    """
    power = state.fly.actuator_torques * state.fly.joint_velocities
    return np.asarray(np.maximum(power, 0.0).sum(axis=1) * terms.elapsed(state))


SMOOTHNESS: Final = (
    RewardTerm("drive_change", 0.0, drive_change, "change of the drive, summed over both sides"),
    RewardTerm("work", 0.0, joint_work, "nJ that the joints do, as sampled at decisions"),
)
"""Rows of a reward table that count nothing until task.weights gives them a weight."""
