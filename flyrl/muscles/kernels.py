"""The maths of muscles, compiled: what the Python classes and a native callback call.

A motor pool stands here as its recruitment table: the shares of strength that add up as neurons
are recruited, which grow from the first to the last and end at 1 (see `pool.MotorPool`).
"""

import numpy as np
from numpy.typing import NDArray

from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray

IntArray = NDArray[np.int64]


@kernel
def tension_of(recruitment: FloatArray, n: int) -> float:
    """Tension at which a pool recruits every neuron up to index `n`, which is clamped to it."""
    tension: float = recruitment[min(max(n, 0), len(recruitment) - 1)]
    return tension


@kernel
def recruited(recruitment: FloatArray, tension: float) -> int:
    """Smallest index whose tension is at least the given one; beyond 1, as for 1.

    What is not a number recruits no more than the first neuron.
    """
    wanted = min(tension, 1.0)
    low, high = 0, len(recruitment) - 1
    while low < high:
        middle = (low + high) // 2
        if recruitment[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def fill_tensions(recruitment: FloatArray, n: IntArray, tension: FloatArray) -> None:
    """Write the tension of every index of `n` (K,) to `tension` (K,)."""
    for i in range(len(n)):
        tension[i] = tension_of(recruitment, n[i])


@kernel
def fill_recruited(recruitment: FloatArray, tension: FloatArray, n: IntArray) -> None:
    """Write the smallest index that reaches every tension (K,) to `n` (K,)."""
    for i in range(len(tension)):
        n[i] = recruited(recruitment, tension[i])


@kernel
def activate(
    recruitment: FloatArray,
    starts: IntArray | FloatArray,
    strengths: FloatArray,
    n: IntArray | FloatArray,
    tension: FloatArray,
    force: FloatArray,
) -> None:
    """Activate M muscles: write their tensions and forces (M,).

    Parameters
    ----------
    recruitment, starts, strengths
        The muscles, see `muscle.PackedMuscles`.
    n
        Whole numbers, (M,): recruit every neuron up to this index. They and `starts` may be of
        float64, which is all that a model of MuJoCo carries.
    """
    for i in range(len(strengths)):
        tension[i] = tension_of(recruitment[int(starts[i]) : int(starts[i + 1])], int(n[i]))
        force[i] = strengths[i] * tension[i]


@kernel
def pull(
    recruitment: FloatArray, strengths: FloatArray, torque: float, tension: FloatArray
) -> float:
    """Torque of an antagonist pair that is asked for some: as near to it as neurons come.

    One muscle turns the joint to positive angles, the other back. The one that is asked for
    recruits against the other, which rests: there, as always, the first neuron is active.

    Parameters
    ----------
    recruitment
        Table of the pool that both have.
    strengths
        Torques with all neurons active, (2,).
    torque
        What is asked for.
    tension
        Of both muscles, written, (2,).
    """
    agonist = 0 if torque >= 0.0 else 1
    antagonist = 1 - agonist
    resting = recruitment[0]
    wanted = (abs(torque) + strengths[antagonist] * resting) / strengths[agonist]
    n = recruited(recruitment, wanted)
    if n > 0 and wanted - recruitment[n - 1] < recruitment[n] - wanted:
        n -= 1
    tension[agonist] = recruitment[n]
    tension[antagonist] = resting
    pulled: float = strengths[0] * tension[0] - strengths[1] * tension[1]
    return pulled


@kernel
def move_by_muscles(
    stiffness: FloatArray,
    strengths: FloatArray,
    recruitment: FloatArray,
    angles: FloatArray,
    targets: FloatArray,
    tension: FloatArray,
    torque: FloatArray,
) -> None:
    """Let antagonist pairs do what J servos would: the inverse map from torque to recruitment.

    A servo would exert the torque stiffness * (target - angle). Its pair comes as near to that as
    it can, see `pull`.

    Parameters
    ----------
    stiffness
        Of the servos, µN mm / rad, (J,).
    strengths
        Of each joint's two muscles, µN mm, (J, 2).
    recruitment
        Table of the pool that all muscles have, (N,).
    angles, targets
        Where the joints are and where the servos would lead them, rad, (J,) each.
    tension
        Written, (J, 2).
    torque
        On the joints, µN mm, written, (J or more,).
    """
    for i in range(len(stiffness)):
        wanted = stiffness[i] * (targets[i] - angles[i])
        torque[i] = pull(recruitment, strengths[i], wanted, tension[i])
