"""Gait measures, on rasters drawn by hand: one character per sample, # in stance, . in swing.

A row per leg, in the order of `anatomy.LEGS`: LF, LM, LH, RF, RM, RH.
"""

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.evaluation import gait


def raster(*rows):
    """Samples (S, 6) from a row per leg; a single row is that of all legs."""
    rows = rows * 6 if len(rows) == 1 else rows
    return np.array([[mark == "#" for mark in row] for row in rows]).T


def test_a_blip_is_no_step():
    # at 2 ms, what lasts one or two samples
    drawn = raster("####.######..####......######.####")
    clean = raster("#################......###########")
    np.testing.assert_array_equal(gait.without_blips(drawn, 0.002), clean)
    assert gait.without_blips(np.empty((0, 6), bool), 0.001).shape == (0, 6)


def test_a_swing_that_does_not_carry_the_body_on_is_no_step():
    drawn = raster("##..##..##..##..##")
    places = np.zeros((18, 3))
    # mm; touchdowns at samples 4, 8, 12, 16: 0.2, 0.1, 0.1 and 0.16 since the one before
    places[[4, 8, 12, 16], 0] = 0.2, 0.3, 0.4, 0.5
    places[16, 2] = 0.06  # rad, 1 mm from the thorax
    kept = raster("##..##########..##")
    np.testing.assert_array_equal(gait.step_raster(drawn, places, 0.02), kept)


def test_a_swing_goes_from_lift_off_to_touchdown_and_only_whole_ones_count():
    assert gait.swings(raster("..##...#..##..")) == [[(4, 7), (8, 10)]] * 6


def test_strides_go_from_touchdown_to_touchdown():
    # touchdowns at 2, 7 and 12: 2 strides in 10 samples of 10 ms
    assert gait.stride_frequency_hz(raster("..###..###..###"), 0.01) == pytest.approx(20)
    # with one at 50 Hz: the mean over the legs that stepped
    rows = "..###..###..###", ".#.#.#.#.#.#.#.", *["#" * 15] * 4
    assert gait.stride_frequency_hz(raster(*rows), 0.01) == pytest.approx(35)
    # from 2 to 12: 6 of 10 samples in stance; the long start and end do not count
    assert gait.duty_factor(raster("..###..###..########")) == pytest.approx(0.6)
    once = raster("####...####")
    assert gait.stride_frequency_hz(once, 0.01) is gait.duty_factor(once) is None


STANDS = dict.fromkeys(LEGS, "#" * 16)


@pytest.mark.parametrize(
    ("middle", "front", "hind", "strength"),
    [
        # LM swings from 2 to 6, RF from 4 to 8, RH from 3 to 7: all three from 4 to 6, any from 2
        ("##....##########", "####....########", "###....#########", 2 / 6),
        ("#..#############", "####..##########", "#######..#######", 0),  # never together
        # partners are the nearest swings
        ("########..######", "##..####..##..##", "########..######", 1),
    ],
)
def test_a_tripod_is_as_strong_as_its_legs_swing_together(middle, front, hind, strength):
    rows = {**STANDS, "LM": middle, "RF": front, "RH": hind}
    assert gait.tripod_coordination(raster(*rows.values())) == pytest.approx(strength)


def test_a_leg_that_never_swings_leaves_a_tripod_without_strength():
    rows = ["####" if leg == "RF" else "#.##" for leg in LEGS]
    # the other one has it, a perfect one
    assert gait.tripod_coordination(raster(*rows)) == 1
    assert gait.tripod_coordination(raster("####")) is None


def test_reflex_activity_counts_a_leg_once():
    retraction, stumbling = np.zeros((2, 4, 6), bool)
    retraction[:, 0] = True
    stumbling[:2, 0] = stumbling[0, 1] = True
    assert gait.reflex_activity(retraction, stumbling) == pytest.approx(5 / 24)


def test_variation_is_the_change_per_second():
    drive = np.array([[0, 0], [1, 0], [0, 0], [1, 0.5]])
    # left 2, right 0.5 in 0.04 s
    time_s = np.array([0, 0.02, 0.04, 0.06])
    assert gait.drive_variation(drive, time_s) == pytest.approx(1.25 / 0.04)
    # one that is held varies by nothing; one decision has no variation
    assert gait.drive_variation(drive[[0, 1, 1, 1]], time_s) == 0
    assert gait.drive_variation(drive[:2], time_s[:2]) is None
