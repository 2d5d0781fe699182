"""A creature that recruits more and more of its motor neurons, step by step."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import mujoco
import numpy as np

from flyrl.muscles import Creature, movement
from flyrl.validation import FloatArray, at_least, positive

STEP: Final = 20
"""Neurons that a step recruits, as in cortex, Simulated Muscles, R. McIntyre."""


class Moment(NamedTuple):
    """A creature in the course of recruitment.

    Attributes
    ----------
    n : what all muscles are activated with.
    tension : of each of the M muscles, (M,) within 0 and 1.
    bend : sum of the angles of all hinge joints, rad.
    is_last : whether n changes next, or all ends.
    """

    n: int
    tension: FloatArray
    bend: float
    is_last: bool


def recruit_stepwise(
    creature: Creature, step: int = STEP, hold_s: float = 1.0, frame_s: float = 0.04
) -> Iterator[Moment]:
    """Activate all muscles with 0, `step`, 2 `step`, … up to the last neuron of the longest pool.

    Parameters
    ----------
    creature
        It starts in its initial pose; its data move along, and hold what is at the moment given.
    step
        Neurons that are recruited at a time, 1 or more.
    hold_s
        For how long every n is held, s.
    frame_s
        From one moment to the next, s.
    """
    at_least("step", step, 1)
    frames = max(1, round(positive("hold_s", hold_s) / positive("frame_s", frame_s)))
    model, data = creature.model, creature.data
    per_frame = max(1, round(frame_s / model.opt.timestep))
    move = movement(creature)
    last = last_neuron(creature)
    mujoco.mj_resetData(model, data)
    for n in [*range(0, last, step), last]:
        tension = move(np.full(len(creature.muscles), n))
        for frame in range(frames):
            for _ in range(per_frame):
                mujoco.mj_step(model, data)
            # a step leaves the places of bodies as they were before it
            mujoco.mj_kinematics(model, data)
            yield Moment(n, tension, bend(creature), frame == frames - 1)


def last_neuron(creature: Creature) -> int:
    """Index of the last neuron of a creature's longest motor pool."""
    return max(len(attached.muscle.pool) for attached in creature.muscles) - 1


def bend(creature: Creature) -> float:
    """How far a creature is bent at the moment: sum of the angles of all hinge joints, rad."""
    hinges = creature.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    return float(creature.data.qpos[creature.model.jnt_qposadr[hinges]].sum())
