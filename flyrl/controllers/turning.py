"""Turning: how a two-dimensional descending drive steers the oscillators of the legs.

Source: the turning task of NeuroMechFly v2 (Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y).
"""

import numpy as np
from numpy.typing import ArrayLike

from flyrl.anatomy import LEGS
from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray, float_array, positive


@kernel
def modulate(
    drive: FloatArray,
    frequency: FloatArray,
    amplitude: FloatArray,
    freqs: FloatArray,
    amps: FloatArray,
) -> None:
    """Write the oscillators' intrinsic frequencies and amplitudes under a drive.

    Parameters
    ----------
    drive
        Left and right, shape (2,). A side's amplitude is the drive's size; a negative drive makes
        it step backwards, and zero (of positive sign) lets its magnitude decay.
    frequency, amplitude
        Stepping frequency, Hz, and amplitude at a drive of 1, shape (6,).
    freqs
        Output, Hz, shape (6,), left legs first.
    amps
        Output, shape (6,), left legs first.
    """
    legs_per_side = freqs.size // 2
    for i in range(freqs.size):
        side = drive[i // legs_per_side]
        freqs[i] = frequency[i] if side >= 0.0 else -frequency[i]
        amps[i] = abs(side) * amplitude[i]


def modulated(drive: ArrayLike, frequency_hz: float) -> tuple[FloatArray, FloatArray]:
    """Intrinsic frequencies (Hz) and amplitudes under a drive, each of shape (6,).

    Raises
    ------
    ValueError
        If the drive is not two finite numbers or the frequency is not above 0.
    """
    checked = float_array("drive", drive, (2,))
    freqs, amps = np.empty(len(LEGS)), np.empty(len(LEGS))
    frequency = np.full(len(LEGS), positive("frequency_hz", frequency_hz))
    modulate(checked, frequency, np.ones(len(LEGS)), freqs, amps)
    return freqs, amps
