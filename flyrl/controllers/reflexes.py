"""Reflexes of the hybrid controller: a leg lifts out of a hole, or over what it stumbles on.

Each leg carries an amount for each of the two reflexes, which grows while the reflex is triggered
and decays otherwise, and which shifts the leg's target angles along a fixed direction.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y (NeuroMechFly v2), with the figures
of its two published parameter sets.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from flyrl.anatomy import (
    LEG_DOFS,
    RIGHT_LEG_MIRROR,
    SENSED_SEGMENTS,
    STUMBLING_SEGMENTS,
)
from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray, float_array, not_negative, one_of

TWO_PI: Final = 2.0 * np.pi

ReflexesName = Literal["classic", "current"]

NO_LEG: Final = -1

_SENSORS_PER_LEG: Final = len(SENSED_SEGMENTS)


@dataclass(frozen=True)
class ReflexParameters:
    """Figures of the two reflexes.

    Attributes
    ----------
    front, middle, hind
        Shift of a left leg's target angles per unit of correction, rad, ordered as
        `anatomy.LEG_DOFS`.
    mirror_right
        Whether right legs shift as mirror images of left legs, or by the same angles.
    retraction_rates, stumbling_rates
        Growth while triggered and decay otherwise, 1/s.
    cap
        Largest correction that is used.
    persistence_threshold
        Retraction amount above which retracting a leg makes it persist.
    persistence_s
        How long a leg then keeps being retracted, s.
    gain
        Gain on the correction at five phases: start of swing, its middle, its (extended) end,
        middle of stance, end of stance. Linear in between.
    swing_extension
        How much later than recorded a swing ends, for the gain's third phase and for adhesion, rad.
    retraction_ends_stumbling
        Whether the stumbling amount is dropped to 0 while a leg is being retracted.
    retraction_margin
        How much further below the thorax than the third lowest leg the lowest must be, mm.
    stumbling_force
        Contact force along the heading below which a leg stumbles, µN.
    stumbling_segments
        Segments of `anatomy.SENSED_SEGMENTS` whose contact counts.

    Raises
    ------
    ValueError
        If a vector has the wrong length, or a rate, duration or margin is negative.
    """

    front: tuple[float, ...]
    middle: tuple[float, ...]
    hind: tuple[float, ...]
    mirror_right: bool
    retraction_rates: tuple[float, float]
    stumbling_rates: tuple[float, float]
    cap: float
    persistence_threshold: float
    persistence_s: float
    gain: tuple[float, ...]
    swing_extension: float
    retraction_ends_stumbling: bool
    retraction_margin: float = 0.05
    stumbling_force: float = -1.0
    stumbling_segments: tuple[str, ...] = STUMBLING_SEGMENTS

    def __post_init__(self) -> None:
        for segment in self.stumbling_segments:
            one_of("stumbling_segments", segment, SENSED_SEGMENTS)
        for name in ("front", "middle", "hind"):
            float_array(name, getattr(self, name), (len(LEG_DOFS),))
        float_array("gain", self.gain, (5,))
        for name in ("retraction_rates", "stumbling_rates"):
            float_array(name, getattr(self, name), (2,), minimum=0.0)
        for name in (
            "persistence_threshold",
            "persistence_s",
            "swing_extension",
            "retraction_margin",
        ):
            not_negative(name, getattr(self, name))
        if math.isnan(self.cap) or self.cap < 0:
            raise ValueError(f"cap must be a number of at least 0, or inf, got {self.cap!r}")
        if not math.isfinite(self.stumbling_force):
            raise ValueError(f"stumbling_force must be finite, got {self.stumbling_force!r}")

    def stumbling_sensors(self) -> FloatArray:
        """1 for each of `anatomy.SENSED_SEGMENTS` whose contact counts, else 0, shape (6,)."""
        return np.array([float(name in self.stumbling_segments) for name in SENSED_SEGMENTS])

    def leg_vectors(self) -> FloatArray:
        """Shift of every leg's target angles per unit of correction, rad, shape (6, 7)."""
        left = np.array([self.front, self.middle, self.hind])
        right = left * np.array(RIGHT_LEG_MIRROR) if self.mirror_right else left
        return np.concatenate([left, right])

    def gain_phases(self, swing_ends: FloatArray) -> FloatArray:
        """Phases at which `gain` is given, rad, shape (6, 5), from the recorded swing ends."""
        return np.stack(
            [
                np.zeros_like(swing_ends),
                swing_ends / 2,
                swing_ends + self.swing_extension,
                (swing_ends + TWO_PI) / 2,
                np.full_like(swing_ends, TWO_PI),
            ],
            axis=1,
        )


CLASSIC: Final = ReflexParameters(
    front=(0, 0, 0, -0.02, 0, 0.016, 0),
    middle=(-0.015, 0, 0, 0.004, 0, 0.01, -0.008),
    hind=(0, 0, 0, -0.01, 0, 0.005, 0),
    mirror_right=False,
    retraction_rates=(500.0, 1000.0 / 3.0),
    stumbling_rates=(2000.0, 500.0),
    cap=math.inf,
    persistence_threshold=0.0,
    persistence_s=0.0,
    gain=(1.0, 1.0, 1.0, 1.0, 1.0),
    swing_extension=0.0,
    retraction_ends_stumbling=False,
)
"""Figures of flygym 0.2.5."""

CURRENT: Final = ReflexParameters(
    front=(-0.03, 0, 0, -0.03, 0, 0.03, 0.03),
    middle=(-0.015, 0.001, 0.025, -0.02, 0, -0.02, 0),
    hind=(0, 0, 0, -0.02, 0, 0.01, -0.02),
    mirror_right=True,
    retraction_rates=(800.0, 700.0),
    stumbling_rates=(2200.0, 1800.0),
    cap=80.0,
    persistence_threshold=20.0,
    persistence_s=2e-3,
    gain=(0.0, 0.8, 0.0, -0.1, 0.0),
    swing_extension=math.pi / 4,
    retraction_ends_stumbling=True,
)
"""Figures of flygym 1.2.1, as durations and rates (there they are counts of steps)."""

REFLEXES: Final[dict[ReflexesName, ReflexParameters]] = {"classic": CLASSIC, "current": CURRENT}


@kernel
def retraction_leg(thorax_z: float, end_effector_z: FloatArray, margin: float) -> int:
    """Index of the leg that hangs in a hole, or -1.

    It is the deepest leg, if its depth below the thorax exceeds the third largest by more than
    `margin`: on even ground at least three legs stand at much the same depth.

    Parameters
    ----------
    thorax_z, end_effector_z
        Heights, mm, number and shape (6,).
    margin
        mm.
    """
    deepest = NO_LEG
    first = second = third = -np.inf
    for i in range(end_effector_z.size):
        depth = thorax_z - end_effector_z[i]
        if depth > first:
            deepest = i
            first, second, third = depth, first, second
        elif depth > second:
            second, third = depth, second
        elif depth > third:
            third = depth
    return deepest if first - third > margin else NO_LEG


@kernel
def stumbles(
    contact_forces_w: FloatArray,
    heading_w: FloatArray,
    leg: int,
    force_threshold: float,
    sensors: FloatArray,
) -> bool:
    """Whether one of a leg's segments that count is pushed back along the heading.

    Parameters
    ----------
    contact_forces_w
        µN, world frame, shape (36, 3), ordered as `anatomy.CONTACT_SEGMENTS`.
    heading_w
        Unit vector, world frame, shape (3,).
    leg
        Index into `anatomy.LEGS`.
    force_threshold
        µN; a smaller (more negative) force along the heading counts.
    sensors
        1 for each of `anatomy.SENSED_SEGMENTS` that counts, else 0, shape (6,).
    """
    for sensor in range(_SENSORS_PER_LEG):
        if sensors[sensor] == 0.0:
            continue
        row = leg * _SENSORS_PER_LEG + sensor
        along = (
            contact_forces_w[row, 0] * heading_w[0]
            + contact_forces_w[row, 1] * heading_w[1]
            + contact_forces_w[row, 2] * heading_w[2]
        )
        if along < force_threshold:
            return True
    return False


@kernel
def reflex_amount(
    amount: float, is_triggered: bool, growth: float, decay: float, timestep: float
) -> float:
    """Next amount of a reflex: grown by growth · timestep, or decayed to no less than 0."""
    if is_triggered:
        return amount + growth * timestep
    decayed = amount - decay * timestep
    return decayed if decayed > 0.0 else 0.0


@kernel
def reflex_step(
    retraction: FloatArray,
    stumbling: FloatArray,
    persistence: FloatArray,
    thorax_z: float,
    end_effector_z: FloatArray,
    contact_forces_w: FloatArray,
    heading_w: FloatArray,
    retraction_margin: float,
    stumbling_force: float,
    retraction_rates: FloatArray,
    stumbling_rates: FloatArray,
    persistence_threshold: float,
    persistence_s: float,
    retraction_ends_stumbling: float,
    stumbling_sensors: FloatArray,
    timestep: float,
) -> None:
    """Advance the reflexes of all legs in place by one time step.

    Parameters
    ----------
    retraction, stumbling
        Amounts, shape (6,).
    persistence
        Time for which each leg keeps being retracted, s, shape (6,).
    thorax_z, end_effector_z
        Heights, mm, number and shape (6,).
    contact_forces_w, heading_w
        As in `stumbles`.
    retraction_margin, stumbling_force, persistence_threshold, persistence_s
        As in `ReflexParameters`.
    retraction_rates, stumbling_rates
        Growth and decay, 1/s, shape (2,).
    retraction_ends_stumbling
        1 or 0.
    stumbling_sensors
        As in `stumbles`.
    timestep
        s.
    """
    in_hole = retraction_leg(thorax_z, end_effector_z, retraction_margin)
    if in_hole != NO_LEG and retraction[in_hole] > persistence_threshold:
        persistence[in_hole] = persistence_s
    for leg in range(retraction.size):
        # Half a step of tolerance, or rounding would decide whether the last step counts.
        persists = persistence[leg] > 0.5 * timestep
        persistence[leg] = max(0.0, persistence[leg] - timestep) if persists else 0.0
        retraction[leg] = reflex_amount(
            retraction[leg],
            leg == in_hole or persists,
            retraction_rates[0],
            retraction_rates[1],
            timestep,
        )
        stumbling[leg] = reflex_amount(
            stumbling[leg],
            stumbles(contact_forces_w, heading_w, leg, stumbling_force, stumbling_sensors),
            stumbling_rates[0],
            stumbling_rates[1],
            timestep,
        )
        if retraction[leg] > 0.0 and retraction_ends_stumbling != 0.0:
            stumbling[leg] = 0.0


@kernel
def phase_gain(theta: float, gain_phases: FloatArray, gain: FloatArray) -> float:
    """Gain on a correction at a phase in [0, 2π): linear between the given points.

    Parameters
    ----------
    theta
        rad, in [0, 2π].
    gain_phases, gain
        Points, rad and -, ascending, the first at 0 and the last at 2π; shape (5,).
    """
    last = gain_phases.size - 1
    k = 1
    while k < last and theta > gain_phases[k]:
        k += 1
    slope = (gain[k] - gain[k - 1]) / (gain_phases[k] - gain_phases[k - 1])
    value: float = gain[k - 1] + slope * (theta - gain_phases[k - 1])
    return value


@kernel
def net_correction(
    retraction: float,
    stumbling: float,
    cap: float,
    theta: float,
    gain_phases: FloatArray,
    gain: FloatArray,
) -> float:
    """Correction of a leg: retraction before stumbling, capped, times the gain at a phase."""
    amount = retraction if retraction > 0.0 else stumbling
    return min(amount, cap) * phase_gain(theta, gain_phases, gain)
