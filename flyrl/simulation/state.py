"""What flies look like at one moment."""

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
class FlyState:
    """A snapshot of n simulations; the first axis of every array is the simulation.

    Attributes
    ----------
    time
        s since the reset, (n,).
    position_w, velocity_w
        Thorax, mm and mm/s, (n, 3), world frame.
    rotation_w
        Thorax to world, (n, 3, 3); its first column is the heading.
    angular_velocity_w
        Thorax, rad/s, (n, 3), world frame.
    joint_angles, joint_velocities, actuator_torques
        rad, rad/s, µN·mm, (n, 42), ordered as anatomy.JOINTS.
    contact_forces_w
        Sum of the ground's forces on each sensed segment in the last physics step, µN,
        (n, 36, 3), ordered as anatomy.CONTACT_SEGMENTS.
    end_effectors_w
        Tarsus5 of each leg, mm, (n, 6, 3).
    command
        What the leg controller was last commanded, (n, k), for most the descending drive (left,
        right): what the brain knows of. With latency it is at the legs only later.
    phases, magnitudes
        Of the legs' oscillators (or steps, for the rule-based controller), rad and 1, (n, 6);
        zeros for a controller without.
    retraction, stumbling
        Correction amounts of the two reflexes, (n, 6); zeros for a controller without.
    adhesion
        1 while a leg grips, else 0, (n, 6).
    muscle_tensions
        Of the legs' muscles, from 0 to 1: at each joint, ordered as anatomy.JOINTS, of the one that
        turns it to positive angles, then of the other, (n, 84); (n, 0) of a fly without muscles.
    fictive_velocity_b
        Of a tethered fly, the way that the ball turns back under it: forward and leftward, mm/s,
        and yaw rate, rad/s, (n, 3); zeros without a ball.
    is_unstable
        Whether the simulation blew up since its reset, (n,).
    """

    time: Array
    position_w: Array
    velocity_w: Array
    rotation_w: Array
    angular_velocity_w: Array
    joint_angles: Array
    joint_velocities: Array
    actuator_torques: Array
    contact_forces_w: Array
    end_effectors_w: Array
    command: Array
    phases: Array
    magnitudes: Array
    retraction: Array
    stumbling: Array
    adhesion: Array
    muscle_tensions: Array
    fictive_velocity_b: Array
    is_unstable: NDArray[np.bool_]

    @property
    def actuation(self) -> Array:
        """What the fly does by command, as a rollout records it: `command`."""
        return self.command

    @property
    def heading_w(self) -> Array:
        """Unit vectors along the thorax, tail to head, (n, 3)."""
        return self.rotation_w[:, :, 0]

    @property
    def yaw(self) -> Array:
        """Heading's angle from +x, counter-clockwise from above, rad in (-pi, pi], (n,)."""
        return np.arctan2(self.rotation_w[:, 1, 0], self.rotation_w[:, 0, 0])

    @property
    def up_b(self) -> Array:
        """The world's up direction in the thorax frame, (n, 3); (0, 0, 1) when level."""
        return self.rotation_w[:, 2, :]


@dataclass(frozen=True)
class LegStates:
    """What the legs of one simulation do; (6,) each, ordered as anatomy.LEGS.

    Attributes
    ----------
    grips
        Whether a leg is told to grip.
    retracts, stumbles
        Whether the retraction reflex, or the stumbling reflex, corrects a leg.
    """

    grips: Flags
    retracts: Flags
    stumbles: Flags
