"""The descending drive."""

import numpy as np
import pytest

from flyrl.controllers.cpg import modulated


@pytest.mark.parametrize(
    ("drive", "freqs", "amps"),
    [
        ((1.2, 0.2), (12, 12), (1.2, 0.2)),
        ((-0.5, 1.0), (-12, 12), (0.5, 1.0)),
        ((0.0, -0.1), (12, -12), (0.0, 0.1)),
    ],
)
def test_each_side_follows_its_drive(drive, freqs, amps):
    actual_freqs, actual_amps = modulated(drive, 12.0)
    np.testing.assert_array_equal(actual_freqs, np.repeat(freqs, 3))
    np.testing.assert_array_equal(actual_amps, np.repeat(amps, 3))


@pytest.mark.parametrize(
    ("drive", "frequency", "message"),
    [
        ((1.0,), 12.0, r"drive must have shape \(2,\), got shape \(1,\)"),
        ((1.0, np.nan), 12.0, "drive must be finite"),
        ((1.0, 1.0), -12.0, "frequency_hz must be a finite number above 0, got -12.0"),
    ],
)
def test_arguments_are_checked(drive, frequency, message):
    with pytest.raises(ValueError, match=message):
        modulated(drive, frequency)
