"""Muscles: a whole number of recruited motor neurons goes in, force and tension come out.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray, float_array, not_negative

IntArray = NDArray[np.int64]

_MODES_BEYOND_8_BITS = ("I", "F")
"""Prefixes of Pillow's modes whose values do not fit into 8 bits."""


@dataclass(frozen=True, eq=False)
class MotorPool:
    """The motor neurons of a muscle, as a 1-D array of their forces.

    From cortex, Simulated Muscles, R. McIntyre.

    Attributes
    ----------
    forces : (N,), force of each motor neuron (how many fibres it drives), in any unit: only their
        shares count. Ordered as neurons are recruited, first the first.
    recruitment : (N,), share of the pool's force at which the neurons up to each index are active:
        it never falls, and ends at exactly 1.

    Raises
    ------
    ValueError
        If `forces` is not 1-D or empty, or holds what is no finite number, a negative force, or
        nothing but 0.
    """

    forces: FloatArray
    recruitment: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        forces = float_array("forces", self.forces, (np.size(self.forces),), minimum=0.0)
        with np.errstate(over="ignore"):
            sums = np.cumsum(forces)
        if not forces.any() or np.isinf(sums[-1]):
            raise ValueError(f"forces must have a finite sum above 0, got {self.forces!r:.60}")
        for name, array in (("forces", forces), ("recruitment", sums / sums[-1])):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def from_image(cls, path: Path | str) -> Self:
        """Read a pool from an image, a neuron per pixel of its first row, left to right.

        A neuron's force is 255 - the pixel's blue channel: white is weakest, dark red (like every
        colour without blue) strongest. Images of other kinds (greyscale, with a palette) are first
        made red, green and blue; transparency does not count.

        Parameters
        ----------
        path : of an image with 8 bits per channel, in any format that Pillow reads.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If the file cannot be read as such an image, or its first row is empty or all white.
        """
        path = Path(path)
        row = _first_row(path)
        forces = 255.0 - row[:, 2].astype(np.float64)
        if forces.size == 0 or not forces.any():
            what = "is empty" if forces.size == 0 else "is all white, without any force"
            raise ValueError(f"image of a motor pool {path}: its first row {what}")
        return cls(forces)

    def __len__(self) -> int:
        return self.forces.size


def _first_row(path: Path) -> NDArray[np.uint8]:
    """First row of an image, (width, 3): red, green, blue."""
    try:
        with Image.open(path) as image:
            if image.mode.startswith(_MODES_BEYOND_8_BITS):
                raise ValueError(f"8 bits per channel are allowed, its mode is {image.mode}")
            # by way of RGBA, since Pillow warns where palettes lose their transparency
            first = image.crop((0, 0, image.width, 1)).convert("RGBA").convert("RGB")
    except FileNotFoundError:
        raise FileNotFoundError(f"image of a motor pool {path}: there is no such file") from None
    # what Pillow raises for broken files depends on their format
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise ValueError(f"image of a motor pool {path} cannot be read: {error}") from error
    return np.asarray(first)[0] if first.width else np.empty((0, 3), np.uint8)


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

    # a number gives a number, an array an array; a type checker does not see which

    def tension(self, n: ArrayLike) -> Any:
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
        return self.pool.recruitment[np.clip(whole_numbers("n", n), 0, len(self.pool) - 1)]

    def force(self, n: ArrayLike) -> Any:
        """Force that it exerts, strength * tension; parameters and errors as of `tension`."""
        return self.strength * self.tension(n)

    def recruit(self, tension: ArrayLike) -> Any:
        """Return the smallest n whose tension is at least the given one: the inverse of `tension`.

        Parameters
        ----------
        tension : finite number, or an array of them in any shape. More than 1 cannot be had and
            counts as 1, less than 0 as 0.

        Returns
        -------
        An int, or an array of the shape of `tension`.

        Raises
        ------
        ValueError
            If `tension` holds anything but finite numbers.
        """
        wanted = float_array("tension", tension, np.shape(tension))
        n = np.asarray(np.searchsorted(self.pool.recruitment, np.minimum(wanted, 1.0)))
        return n if n.ndim else int(n)


class PackedMuscles(NamedTuple):
    """Several muscles in three arrays.

    Attributes
    ----------
    recruitment : recruitment tables of all M muscles, one behind the other.
    starts : (M + 1,), where each muscle's table begins in it, and where the last one ends.
    strengths : (M,), their strengths.
    """

    recruitment: FloatArray
    starts: IntArray
    strengths: FloatArray

    def tensions(self, n: NDArray[Any]) -> FloatArray:
        """Tensions, (..., M), with every neuron recruited up to `n`, whole numbers, (..., M)."""
        last = np.clip(n, 0, np.diff(self.starts) - 1).astype(np.int64)
        tensions: FloatArray = self.recruitment[self.starts[:-1] + last]
        return tensions


def pack_muscles(muscles: Sequence[Muscle]) -> PackedMuscles:
    """Pack M muscles, at least one, in their order."""
    tables = [muscle.pool.recruitment for muscle in muscles]
    strengths = np.array([muscle.strength for muscle in muscles])
    return PackedMuscles(np.concatenate(tables), np.cumsum([0, *map(len, tables)]), strengths)


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
        array = np.empty(0)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} must be whole numbers within 64 bits, got {value!r}")
    if array.dtype == np.uint64:
        array = np.minimum(array, np.uint64(np.iinfo(np.int64).max))
    return array.astype(np.int64)


# ------------------------------------------------------------------ kernels
# A motor pool stands here as its recruitment table, see `MotorPool`.


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
