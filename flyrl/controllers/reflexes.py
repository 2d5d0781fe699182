"""Reflexes of the hybrid controller: a leg lifts out of a hole, or over what it stumbles on.

Each leg carries an amount for each of the two reflexes, which grows while the reflex is triggered
and decays otherwise, and which shifts the leg's target angles along a fixed direction.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y (NeuroMechFly v2), with the figures
of its two published parameter sets.
"""

import math
from typing import Any, Final, Literal

import numpy as np

from flyrl.anatomy import SENSED_SEGMENTS, STUMBLING_SEGMENTS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_LEGS
from flyrl.validation import FloatArray

ReflexesName = Literal["classic", "current"]

REFLEXES: Final[dict[ReflexesName, dict[str, Any]]] = {
    "classic": {  # of flygym 0.2.5
        "front": (0, 0, 0, -0.02, 0, 0.016, 0),
        "middle": (-0.015, 0, 0, 0.004, 0, 0.01, -0.008),
        "hind": (0, 0, 0, -0.01, 0, 0.005, 0),
        "mirror_right": False,
        "retraction_rates": (500.0, 1000.0 / 3.0),
        "stumbling_rates": (2000.0, 500.0),
        "cap": math.inf,
        "persistence_threshold": 0.0,
        "persistence_s": 0.0,
        "gain": (1.0, 1.0, 1.0, 1.0, 1.0),
        "swing_extension": 0.0,
        "retraction_ends_stumbling": False,
        "retraction_margin": 0.05,
        "stumbling_force": -1.0,
        "stumbling_segments": STUMBLING_SEGMENTS,
    },
    "current": {  # of flygym 1.2.1, as durations and rates (there they are counts of steps)
        "front": (-0.03, 0, 0, -0.03, 0, 0.03, 0.03),
        "middle": (-0.015, 0.001, 0.025, -0.02, 0, -0.02, 0),
        "hind": (0, 0, 0, -0.02, 0, 0.01, -0.02),
        "mirror_right": True,
        "retraction_rates": (800.0, 700.0),
        "stumbling_rates": (2200.0, 1800.0),
        "cap": 80.0,
        "persistence_threshold": 20.0,
        "persistence_s": 2e-3,
        "gain": (0.0, 0.8, 0.0, -0.1, 0.0),
        "swing_extension": math.pi / 4,
        "retraction_ends_stumbling": True,
        "retraction_margin": 0.05,
        "stumbling_force": -1.0,
        "stumbling_segments": STUMBLING_SEGMENTS,
    },
}
"""Published figures of the reflexes, see `hybrid.Hybrid`."""

NO_LEG: Final = -1

_SENSORS_PER_LEG: Final = len(SENSED_SEGMENTS)

PLAIN_REFLEX_PARAMETERS: Final = (
    "retraction_margin", "stumbling_force", "persistence_threshold", "persistence_s",
    "retraction_ends_stumbling", "cap", "gain",
)  # fmt: skip
"""Parameters that kernels take unchanged from `REFLEXES`."""


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
def stumbles(parameters: Any, senses: Any, leg: int) -> bool:
    """Whether one of a leg's segments that count is pushed back along the heading."""
    heading_w = senses.heading_w
    for sensor in range(_SENSORS_PER_LEG):
        if parameters.stumbling_sensors[sensor] == 0.0:
            continue
        force_w = senses.contact_forces_w[leg * _SENSORS_PER_LEG + sensor]
        along = force_w[0] * heading_w[0] + force_w[1] * heading_w[1] + force_w[2] * heading_w[2]
        if along < parameters.stumbling_force:
            return True
    return False


@kernel
def reflex_amount(amount: float, is_triggered: bool, rates: FloatArray, timestep: float) -> float:
    """Next amount of a reflex that grows, or decays to no less than 0, at its rates, 1/s, (2,)."""
    if is_triggered:
        return amount + rates[0] * timestep  # type: ignore[no-any-return]
    decayed: float = amount - rates[1] * timestep
    return decayed if decayed > 0.0 else 0.0


@kernel
def reflex_step(parameters: Any, state: Any, senses: Any) -> None:
    """Advance the reflexes of all legs in place by one time step.

    Parameters
    ----------
    parameters
        Record that `hybrid.Hybrid.parameters` returns.
    state
        Record that `hybrid.Hybrid.initial_state` returns.
    senses
        Record of type `controller.SENSES`.
    """
    retraction, stumbling, persistence = state.retraction, state.stumbling, state.persistence
    timestep = parameters.timestep
    in_hole = retraction_leg(senses.thorax_z, senses.end_effector_z, parameters.retraction_margin)
    if in_hole != NO_LEG and retraction[in_hole] > parameters.persistence_threshold:
        persistence[in_hole] = parameters.persistence_s
    for leg in range(NUM_LEGS):
        # Half a step of tolerance, or rounding would decide whether the last step counts.
        persists = persistence[leg] > 0.5 * timestep
        persistence[leg] = max(0.0, persistence[leg] - timestep) if persists else 0.0
        is_retracted, is_stumbling = leg == in_hole or persists, stumbles(parameters, senses, leg)
        retraction[leg] = reflex_amount(
            retraction[leg], is_retracted, parameters.retraction_rates, timestep
        )
        stumbling[leg] = reflex_amount(
            stumbling[leg], is_stumbling, parameters.stumbling_rates, timestep
        )
        if retraction[leg] > 0.0 and parameters.retraction_ends_stumbling != 0.0:
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
def net_correction(parameters: Any, state: Any, leg: int, theta: float) -> float:
    """Correction of a leg: retraction before stumbling, capped, times the gain at a phase."""
    amount = state.retraction[leg] if state.retraction[leg] > 0.0 else state.stumbling[leg]
    gain = phase_gain(theta, parameters.gain_phases[leg], parameters.gain)
    return min(amount, parameters.cap) * gain  # type: ignore[no-any-return]
