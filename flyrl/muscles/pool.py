"""Motor pools: which motor neurons a muscle has, and in which order they are recruited.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from flyrl.validation import FloatArray

_MODES_BEYOND_8_BITS = ("I", "F")
"""How the names of Pillow's modes begin whose values do not fit into 8 bits."""


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
        try:
            forces = np.array(self.forces, dtype=np.float64)
        except (TypeError, ValueError):
            raise ValueError(f"forces must be numbers of shape (N,), got {self.forces!r}") from None
        if forces.ndim != 1 or forces.size == 0:
            raise ValueError(
                f"forces must have shape (N,) with N of at least 1, got shape {forces.shape}"
            )
        for what, wrong in (("finite", ~np.isfinite(forces)), ("at least 0", forces < 0)):
            if wrong.any():
                first = int(np.flatnonzero(wrong)[0])
                raise ValueError(f"forces must be {what}, got {forces[first]} at neuron {first}")
        with np.errstate(over="ignore"):
            sums = np.cumsum(forces)
        if not 0 < sums[-1] < np.inf:
            what = "are all 0" if sums[-1] == 0 else "add up to more than a float64 holds"
            raise ValueError(
                f"forces must have a finite sum above 0, got {forces.size} that {what}"
            )
        self._set("forces", forces)
        self._set("recruitment", sums / sums[-1])

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

    def _set(self, name: str, array: FloatArray) -> None:
        array.flags.writeable = False
        object.__setattr__(self, name, array)


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
