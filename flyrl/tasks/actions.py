"""What an action of a task is, and what it commands the body to do."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

DRIVE_LOW: Final = -0.5
DRIVE_HIGH: Final = 1.5
"""Range of the descending drive on each side."""


@dataclass(frozen=True)
class Drives:
    """Two numbers, which command the descending drive to the left and to the right legs.

    Attributes
    ----------
    low, high
        Range of an action's components, mapped linearly to that of the drive.
    """

    low: float = -1.0
    high: float = 1.0

    is_integer = False

    @property
    def size(self) -> int:
        """Components of an action."""
        return 2

    def commands(self, actions: ArrayLike) -> Array:
        """Map actions (..., 2), clipped to their range, to drives (..., 2)."""
        clipped = np.clip(np.asarray(actions, dtype=np.float64), self.low, self.high)
        share = (clipped - self.low) / (self.high - self.low)
        return DRIVE_LOW + share * (DRIVE_HIGH - DRIVE_LOW)

    def of(self, drives: ArrayLike) -> Array:
        """Map drives to the actions that command them; the inverse of `commands`."""
        share = (np.asarray(drives, dtype=np.float64) - DRIVE_LOW) / (DRIVE_HIGH - DRIVE_LOW)
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Neurons:
    """A number per muscle, which says up to which of its motor neurons it is recruited.

    Attributes
    ----------
    pools
        Number of motor neurons of each muscle, (M,).
    is_integer
        Whether an action is whole numbers: the indices of the neurons, from 0. Otherwise its
        components go from `low` to `high`, which are mapped linearly to the first and to the last
        neuron, and rounded.
    """

    pools: tuple[int, ...]
    is_integer: bool = True

    low = -1.0
    high = 1.0

    def __post_init__(self) -> None:
        if not self.pools or min(self.pools) < 1:
            raise ValueError(f"pools must be numbers of neurons above 0, got {self.pools}")

    @property
    def size(self) -> int:
        """Components of an action."""
        return len(self.pools)

    def commands(self, actions: ArrayLike) -> Array:
        """Map actions (..., M) to the whole numbers of neurons, (..., M), within the pools.

        Raises
        ------
        ValueError
            If whole numbers are asked for, and one is none, or no neuron of its pool.
        """
        given = np.asarray(actions, dtype=np.float64)
        last = np.array(self.pools) - 1.0
        if self.is_integer:
            wrong = given != np.round(given)
            if wrong.any():
                raise ValueError(f"action must be whole numbers, got {given[wrong][0]}")
            if (given < 0.0).any() or (given > last).any():
                raise ValueError(
                    f"action must be whole numbers from 0 to {list(map(int, last))}, got "
                    f"{given.tolist()}"
                )
            return given
        clipped = np.clip(given, self.low, self.high)
        return np.round((clipped - self.low) / (self.high - self.low) * last)

    def of(self, neurons: ArrayLike) -> Array:
        """Map numbers of neurons to the actions that command them; the inverse of `commands`."""
        given = np.asarray(neurons, dtype=np.float64)
        if self.is_integer:
            return given
        last = np.maximum(np.array(self.pools) - 1.0, 1.0)
        return self.low + given / last * (self.high - self.low)


Actions = Drives | Neurons
