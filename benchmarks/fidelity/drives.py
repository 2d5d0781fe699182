"""Fixed sequences of drives, the same numbers for flyrl and for the reference.

Needs NumPy alone, as the reference's interpreter has no flyrl.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS: Final = ("smooth", "abrupt", "turn")

HOLD_S: Final = 0.02
"""s for which a pair of drives is held; a decision of flyrl's tasks."""

LOW: Final = -0.5
HIGH: Final = 1.5
"""Range of a side's drive, as in flyrl's tasks."""

ABRUPT_S: Final = 0.1
"""s for which a random drive is held: long enough to step back, to turn sharply, to tip over."""

_SMOOTH_HZ: Final = (0.3, 2.0)
_SMOOTH_WAVES: Final = 4


def sequence(kind: str, seed: int, seconds: float) -> Array:
    """Drives (left, right) of a kind and a seed, one pair per `HOLD_S`, (k, 2).

    "smooth": each side a sum of four sines of 0.3 to 2 Hz about the middle of the range, kept
    within it; "abrupt": a new pair every `ABRUPT_S`, uniform over the range; "turn": one pair, the
    outer side 0.9 to 1.5, the inner one -0.5 to 0.8, to the left or to the right.
    """
    count = round(seconds / HOLD_S)
    rng = np.random.default_rng([KINDS.index(kind), seed])
    if kind == "smooth":
        time = HOLD_S * np.arange(count)[:, None, None]
        frequency = rng.uniform(*_SMOOTH_HZ, size=(2, _SMOOTH_WAVES))
        phase = rng.uniform(0.0, 2 * np.pi, size=(2, _SMOOTH_WAVES))
        waves: Array = np.sin(2 * np.pi * frequency * time + phase).sum(axis=2)
        # half the range per wave: the sides come to its ends now and then
        middle, swing = (LOW + HIGH) / 2, (HIGH - LOW) / 4
        return np.minimum(np.maximum(middle + swing * waves, LOW), HIGH)
    if kind == "abrupt":
        held = round(ABRUPT_S / HOLD_S)
        pairs = rng.uniform(LOW, HIGH, size=(-(-count // held), 2))
        return np.repeat(pairs, held, axis=0)[:count]
    pair = np.array([rng.uniform(0.9, HIGH), rng.uniform(LOW, 0.8)])
    return np.tile(rng.permutation(pair), (count, 1))
