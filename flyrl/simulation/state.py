"""A snapshot of bodies, as the terms of a task read it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class BodyState(Protocol):
    """A snapshot of n bodies: a dataclass of arrays whose first axis is the simulation.

    Attributes
    ----------
    time
        s since the reset, (n,).
    position_w, velocity_w
        Of the body's middle, mm and mm/s, (n, 3), world frame.
    yaw
        Heading's angle from +x, rad, (n,).
    actuation
        What it does by command, (n, k), as a rollout records it.
    is_unstable
        Whether the simulation blew up since its reset, (n,).
    """

    @property
    def time(self) -> Array: ...  # noqa: D102
    @property
    def position_w(self) -> Array: ...  # noqa: D102
    @property
    def velocity_w(self) -> Array: ...  # noqa: D102
    @property
    def yaw(self) -> Array: ...  # noqa: D102
    @property
    def actuation(self) -> Array: ...  # noqa: D102
    @property
    def is_unstable(self) -> Flags: ...  # noqa: D102


@dataclass(frozen=True)
class LegStates:
    """What the legs of one simulation do; (6,) each, ordered as anatomy.LEGS.

    Attributes
    ----------
    grips
        Whether the adhesion of a leg is on.
    retracts, stumbles
        Whether the retraction reflex, or the stumbling reflex, corrects a leg.
    """

    grips: Flags
    retracts: Flags
    stumbles: Flags
