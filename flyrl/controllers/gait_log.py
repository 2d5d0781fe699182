"""A log of how a fly walks, kept while it walks: work, slip, and what each leg does.

The engine writes it at every physics step where a scene asks for it; nothing reads it while the fly
walks, so that a fly with a log walks as one without, to the bit.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import SENSED_SEGMENTS
from flyrl.controllers.compilation import kernel
from flyrl.controllers.controller import NUM_JOINTS, NUM_LEGS
from flyrl.validation import FloatArray

CONTACT_THRESHOLD: Final = 1.0
"""µN; a leg is on the ground when the ground pushes it harder than this (as in stumbling)."""

STANCE_SPEED: Final = 10.0
"""mm/s; a leg is in stance while it is on the ground and its tip moves more slowly than this.

On flat ground the tips of gripping legs keep below 3 mm/s for 95 % of the time, and swinging ones
reach 100, though not without brushing the ground: by contact alone, some would never swing.
"""

SAMPLING_S: Final = 1e-3
"""Time from one sample of the legs to the next, s, as nearly as physics steps allow."""

_SEGMENTS_PER_LEG: Final = len(SENSED_SEGMENTS)

GAIT_LOG: Final = np.dtype(
    [
        ("last_time", "f8"),  # s, of the last step that was logged
        ("num_steps", "f8"),
        ("num_samples", "f8"),
        ("work", "f8"),  # nJ, done by the servos; what is done on them does not come back
        ("slip", "f8", (NUM_LEGS,)),  # mm, of each leg's tip along the ground while it grips
        ("is_grounded", "f8", (NUM_LEGS,)),
        ("tips_w", "f8", (NUM_LEGS, 2)),  # mm, in the step before
        ("sampled_tips_w", "f8", (NUM_LEGS, 2)),  # mm, at the last sample
    ],
    align=True,
)
"""Record of the running sums; the samples follow it. All float64."""

BITS: Final = ("stance", "adhesion", "retraction", "stumbling")
"""Facts about each leg in a sample. The bit of leg i and the k-th of these is 6 k + i."""


@kernel
def grounded_legs(contact_forces_w: FloatArray, is_grounded: FloatArray) -> None:
    """Tell which legs are on the ground: 1, else 0.

    Parameters
    ----------
    contact_forces_w
        µN, shape (36, 3), ordered as `anatomy.CONTACT_SEGMENTS`.
    is_grounded
        Shape (6,), written.
    """
    for leg in range(NUM_LEGS):
        square = 0.0
        for axis in range(3):
            force = 0.0
            for segment in range(_SEGMENTS_PER_LEG):
                force += contact_forces_w[leg * _SEGMENTS_PER_LEG + segment, axis]
            square += force * force
        is_grounded[leg] = 1.0 if square > CONTACT_THRESHOLD * CONTACT_THRESHOLD else 0.0


@kernel
def _distance(start_w: FloatArray, end_w: FloatArray) -> float:
    """Horizontal distance, mm."""
    dx, dy = end_w[0] - start_w[0], end_w[1] - start_w[1]
    return float(np.sqrt(dx * dx + dy * dy))


@kernel
def log_gait(
    log: Any,
    samples: FloatArray,
    engine: Any,
    head: Any,
    retraction: FloatArray,
    stumbling: FloatArray,
    torques: FloatArray,
    velocities: FloatArray,
) -> None:
    """Log one physics step in place, once its contact forces and grounded legs are known.

    Parameters
    ----------
    log
        Record of type `GAIT_LOG`.
    samples
        The latest samples, shape (places,); sample i stands at i modulo places.
    engine, head
        Records of the model and the simulation (`engine.ENGINE`, `engine.HEAD`), with the legs
        that are on the ground in this step.
    retraction, stumbling
        Amounts of the reflexes, shape (6,).
    torques, velocities
        Of the servos, µN·mm and rad/s, shape (42,).
    """
    timestep, steps_per_sample = engine.timestep, int(engine.steps_per_gait_sample)
    adhesion, grounded = head.output.adhesion, head.is_grounded
    tips_w = head.senses.end_effectors_w
    for servo in range(NUM_JOINTS):
        power = torques[servo] * velocities[servo]
        if power > 0.0:
            log.work += power * timestep
    for leg in range(NUM_LEGS):
        if grounded[leg] != 0.0 and log.is_grounded[leg] != 0.0 and adhesion[leg] != 0.0:
            log.slip[leg] += _distance(log.tips_w[leg], tips_w[leg])
        log.is_grounded[leg] = grounded[leg]
        log.tips_w[leg, 0] = tips_w[leg, 0]
        log.tips_w[leg, 1] = tips_w[leg, 1]
    if int(log.num_steps) % steps_per_sample == 0:
        bits = 0
        longest = np.inf if log.num_samples == 0.0 else STANCE_SPEED * timestep * steps_per_sample
        for leg in range(NUM_LEGS):
            moved = _distance(log.sampled_tips_w[leg], tips_w[leg])
            if grounded[leg] != 0.0 and moved < longest:
                bits |= 1 << leg
            log.sampled_tips_w[leg, 0] = tips_w[leg, 0]
            log.sampled_tips_w[leg, 1] = tips_w[leg, 1]
            if adhesion[leg] != 0.0:
                bits |= 1 << (leg + 6)
            if retraction[leg] > 0.0:
                bits |= 1 << (leg + 12)
            if stumbling[leg] > 0.0:
                bits |= 1 << (leg + 18)
        samples[int(log.num_samples) % len(samples)] = bits
        log.num_samples += 1.0
    log.num_steps += 1.0


def unpack(samples: NDArray[np.uint32]) -> dict[str, NDArray[np.bool_]]:
    """Samples as one raster (T, 6) for each of `BITS`, with a column per leg of `anatomy.LEGS`."""
    flags = (samples[:, np.newaxis] >> np.arange(len(BITS) * NUM_LEGS, dtype=np.uint32)) & 1
    rasters = flags.astype(bool).reshape(len(samples), len(BITS), NUM_LEGS)
    return {name: rasters[:, k] for k, name in enumerate(BITS)}
