"""Muscles: a whole number of recruited motor neurons goes in, force and tension come out.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from flyrl.muscles.kernels import IntArray, fill_recruited, fill_tensions
from flyrl.muscles.pool import MotorPool
from flyrl.validation import FloatArray, not_negative


@dataclass(frozen=True)
class Muscle:
    """A muscle: a motor pool, and the force of its fibres all together.

    Activated with a whole number n, it recruits every neuron with an index up to n. n is clamped to
    the pool, so even 0, or less, recruits the first neuron: a muscle that is to rest at 0 has a
    first neuron without force. From cortex, Simulated Muscles, R. McIntyre.

    Attributes
    ----------
    pool : its motor neurons.
    strength : force when all of them are active, in the unit of the caller; not negative. In a
        creature it is a torque about the muscle's axis, µN mm.

    Raises
    ------
    ValueError
        If `strength` is negative or no finite number.
    """

    pool: MotorPool
    strength: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "strength", not_negative("strength", self.strength))

    @overload
    def tension(self, n: int) -> float: ...
    @overload
    def tension(self, n: ArrayLike) -> float | FloatArray: ...
    def tension(self, n: ArrayLike) -> float | FloatArray:
        """Share of its strength that it exerts: the sense of exertion.

        Parameters
        ----------
        n : whole number, or an array of them in any shape.

        Returns
        -------
        Within 0 and 1: a float, or an array of the shape of `n`.

        Raises
        ------
        ValueError
            If `n` holds anything but whole numbers.
        """
        index = whole_numbers("n", n)
        tension = np.empty(index.shape)
        fill_tensions(self.pool.recruitment, index.ravel(), tension.ravel())
        return tension if tension.ndim else float(tension)

    @overload
    def force(self, n: int) -> float: ...
    @overload
    def force(self, n: ArrayLike) -> float | FloatArray: ...
    def force(self, n: ArrayLike) -> float | FloatArray:
        """Force that it exerts, strength * tension; parameters and errors as of `tension`."""
        return self.strength * self.tension(n)

    @overload
    def recruit(self, tension: float) -> int: ...
    @overload
    def recruit(self, tension: ArrayLike) -> int | IntArray: ...
    def recruit(self, tension: ArrayLike) -> int | IntArray:
        """Return the smallest n whose tension is at least the given one: the inverse of `tension`.

        Parameters
        ----------
        tension : number, or an array of them in any shape. More than 1 cannot be had and counts as
            1, less than 0 as 0.

        Returns
        -------
        An int, or an array of the shape of `tension`.

        Raises
        ------
        ValueError
            If `tension` holds anything but numbers.
        """
        try:
            wanted = np.array(tension, dtype=np.float64)
        except (TypeError, ValueError):
            raise ValueError(f"tension must be numbers, got {tension!r}") from None
        if np.isnan(wanted).any():
            raise ValueError(f"tension must be numbers, got {wanted.tolist()}")
        n = np.empty(wanted.shape, np.int64)
        fill_recruited(self.pool.recruitment, wanted.ravel(), n.ravel())
        return n if n.ndim else int(n)


class PackedMuscles(NamedTuple):
    """Several muscles in three arrays, as `kernels.activate` takes them.

    Attributes
    ----------
    recruitment : recruitment tables of all M muscles, one behind the other.
    starts : (M + 1,), where each muscle's table begins in it, and where the last one ends.
    strengths : (M,), their strengths.
    """

    recruitment: FloatArray
    starts: IntArray
    strengths: FloatArray


def pack_muscles(muscles: Sequence[Muscle]) -> PackedMuscles:
    """Pack M muscles, at least one, in their order."""
    tables = [muscle.pool.recruitment for muscle in muscles]
    starts = np.cumsum([0, *map(len, tables)])
    strengths = np.array([muscle.strength for muscle in muscles])
    return PackedMuscles(np.concatenate(tables), starts.astype(np.int64), strengths)


def whole_numbers(name: str, value: ArrayLike) -> IntArray:
    """Return `value` as an array of int64, of its own shape.

    Raises
    ------
    ValueError
        If it holds anything but whole numbers of integer type, or one beyond 64 bits.
    """
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        raise ValueError(f"{name} must be whole numbers, got {value!r}") from None
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} must be whole numbers within 64 bits, got {value!r}")
    if array.dtype == np.uint64:
        array = np.minimum(array, np.uint64(np.iinfo(np.int64).max))
    return np.array(array, dtype=np.int64, order="C")
