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
    starts: IntArray,
    strengths: FloatArray,
    n: IntArray,
    tension: FloatArray,
    force: FloatArray,
) -> None:
    """Activate M muscles: write their tensions and forces (M,).

    Parameters
    ----------
    recruitment, starts, strengths
        The muscles, see `muscle.PackedMuscles`.
    n
        Whole numbers, (M,): recruit every neuron up to this index.
    """
    for i in range(len(strengths)):
        tension[i] = tension_of(recruitment[starts[i] : starts[i + 1]], n[i])
        force[i] = strengths[i] * tension[i]
