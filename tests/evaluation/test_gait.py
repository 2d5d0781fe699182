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


# LF, LH, RM swing as one; LM, RF, RH too
TRIPOD = raster(*("##..####..##" if leg in ("LF", "LH", "RM") else "#####..####." for leg in LEGS))


def test_a_blip_is_no_step():
    # at 2 ms, what lasts one or two samples
    drawn = raster("####.######..####......######.####")
    clean = raster("#################......###########")
    np.testing.assert_array_equal(gait.without_blips(drawn, 0.002), clean)


def test_nothing_has_no_blips():
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
    found = gait.swings(raster("..##...#..##.."))
    assert found == [[(4, 7), (8, 10)]] * 6


def test_strides_go_from_touchdown_to_touchdown():
    # touchdowns at 2, 7 and 12: 2 strides in 10 samples of 10 ms
    assert gait.stride_frequency_hz(raster("..###..###..###"), 0.01) == pytest.approx(20)


def test_the_frequency_is_the_mean_over_the_legs_that_stepped():
    rows = ["..###..###..###", ".#.#.#.#.#.#.#.", *["#" * 15] * 4]
    # 20 Hz, and 50 Hz
    assert gait.stride_frequency_hz(raster(*rows), 0.01) == pytest.approx(35)


def test_one_touchdown_is_no_stride():
    drawn = raster("####...####")
    assert gait.stride_frequency_hz(drawn, 0.01) is None
    assert gait.duty_factor(drawn) is None


def test_the_duty_factor_counts_whole_strides():
    # from 2 to 12: 6 of 10 samples in stance; the long start and end do not count
    assert gait.duty_factor(raster("..###..###..########")) == pytest.approx(0.6)


def test_a_perfect_tripod_has_strength_1():
    assert gait.tripod_coordination(TRIPOD) == 1


def test_a_tripod_that_swings_partly_together():
    rows = dict.fromkeys(LEGS, "############")
    # LM swings from 2 to 6, RF from 4 to 8, RH from 3 to 7: all three from 4 to 6, any from 2 to 8
    rows |= {"LM": "##....######", "RF": "####....####", "RH": "###....#####"}
    assert gait.tripod_coordination(raster(*rows.values())) == pytest.approx(2 / 6)


def test_legs_of_a_tripod_that_never_swing_together_have_strength_0():
    rows = dict.fromkeys(LEGS, "############")
    rows |= {"LM": "#..#########", "RF": "####..######", "RH": "#######..###"}
    assert gait.tripod_coordination(raster(*rows.values())) == 0


def test_a_leg_that_never_swings_leaves_a_tripod_without_strength():
    rows = ["####" if leg == "RF" else "#.##" for leg in LEGS]
    # the other one has it
    assert gait.tripod_coordination(raster(*rows)) == 1
    assert gait.tripod_coordination(raster("####")) is None


def test_partners_are_the_nearest_swings():
    rows = dict.fromkeys(LEGS, "#" * 16)
    rows |= {"LM": "########..######", "RF": "##..####..##..##", "RH": "########..######"}
    assert gait.tripod_coordination(raster(*rows.values())) == 1


def test_reflex_activity_counts_a_leg_once():
    retraction, stumbling = np.zeros((2, 4, 6), bool)
    retraction[:, 0] = True
    stumbling[:2, 0] = stumbling[0, 1] = True
    assert gait.reflex_activity(retraction, stumbling) == pytest.approx(5 / 24)


def test_a_drive_that_is_held_varies_by_nothing():
    drive = np.array([[0, 0], [1, 0.5], [1, 0.5], [1, 0.5]])
    assert gait.drive_variation(drive, np.array([0, 0.02, 0.04, 0.06])) == 0


def test_variation_is_the_change_per_second():
    drive = np.array([[0, 0], [1, 0], [0, 0], [1, 0.5]])
    # left 2, right 0.5 in 0.04 s
    time_s = np.array([0, 0.02, 0.04, 0.06])
    assert gait.drive_variation(drive, time_s) == pytest.approx(1.25 / 0.04)


def test_one_decision_has_no_variation():
    assert gait.drive_variation(np.ones((2, 2)), np.array([0, 0.02])) is None
