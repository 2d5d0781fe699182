"""Walking statistics of trajectories made by hand: 1 ms apart, numbers worked out on paper."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fidelity.statistics import Trajectory, walking_statistics
from tests.benchmarks.made import standing


def walking() -> Trajectory:
    """A fly that moves along +y at 10 mm/s for 1 s."""
    position_w = np.zeros((1001, 3))
    position_w[:, 1] = 0.01 * np.arange(1001)
    return standing(1001, position_w=position_w)


def swinging(walk: Trajectory, legs: list[int], *swings: tuple[int, int]) -> Trajectory:
    """The same; in each swing these feet go 1 mm forward from the thorax, before it 1 mm back.

    A leg's first swing begins at its first posterior extreme, and so ends its first step's stance.
    """
    knots = [(0, 0.0)]
    for start, end in swings:
        knots += [(start, -1.0), (end, 0.0)]
    knots += [(len(walk.time) - 1, -1.0)]
    along = np.interp(np.arange(len(walk.time)), *zip(*knots, strict=True))
    feet_w = walk.end_effectors_w.copy()
    feet_w[:, legs, :2] = walk.position_w[:, None, :2]
    feet_w[:, legs, 1] += along[:, None]
    return replace(walk, end_effectors_w=feet_w)


def test_speed_and_straightness_of_a_right_angle() -> None:
    """0.6 s along x and 0.8 s along y at 5 mm/s: 3 and 4 mm walked, 5 mm covered in 1.4 s.

    Height counts for neither.
    """
    way = 0.005 * np.arange(1401)
    position_w = np.column_stack(
        [np.minimum(way, 3.0), np.maximum(way - 3.0, 0.0), np.linspace(2.0, 0.0, 1401)]
    )
    figures = walking_statistics(standing(1401, position_w=position_w))
    assert figures["speed"] == pytest.approx(5.0 / 1.4)
    assert figures["straightness"] == pytest.approx(5.0 / 7.0)


def test_a_sway_shorter_than_the_sampling_of_the_path_is_no_way() -> None:
    """Swaying by 1 mm at 10 Hz, on the path's points every 0.1 s by nothing."""
    walk = walking()
    walk.position_w[:, 0] = np.sin(2 * np.pi * 10 * walk.time)
    assert walking_statistics(walk)["straightness"] == pytest.approx(1.0)


def test_yaw_drift_counts_turns_across_the_wrap() -> None:
    """From 170 degrees, 40 degrees left in 0.5 s."""
    turned = np.deg2rad(170 + np.linspace(0, 40, 501))
    walk = standing(501, yaw=np.arctan2(np.sin(turned), np.cos(turned)))
    assert walking_statistics(walk)["yaw_drift"] == pytest.approx(80.0)


def test_strides_of_one_leg() -> None:
    """Anterior extremes at 0.35, 0.45 and 0.57 s of a fly at 10 mm/s: strides of 1.0 and 1.2 mm.

    The foot loses contact for 40 and 30 ms within these 220 ms, and for 50 ms outside. Steps are
    along the heading: of a fly heading along +x, the same feet move sideways.
    """
    walk = swinging(walking(), [3], (310, 350), (410, 450), (540, 570))
    for start, end in ((300, 350), (410, 450), (540, 570)):
        walk.contact[start:end, 3] = False
    figures = walking_statistics(walk)
    assert figures["stride_length"] == pytest.approx(1.1)
    assert figures["stride_frequency"] == pytest.approx(2 / 0.22)
    assert figures["duty_factor"] == pytest.approx(150 / 220)
    assert walking_statistics(replace(walk, yaw=np.zeros(1001)))["stride_length"] is None


@pytest.mark.parametrize(("way", "strides"), [(0.15, 2), (0.25, 3)])
def test_a_twitch_is_no_step(way: float, strides: int) -> None:
    """One of 0.25 mm is a step: it ends at 0.4 s, so there are 3 strides up to 0.57 s."""
    walk = swinging(walking(), [3], (310, 350), (440, 450), (540, 570))
    # the foot goes back by 1 mm in 90 ms all the while
    walk.end_effectors_w[390:401, 3, 1] += np.linspace(0, way + 1 / 9, 11)
    walk.end_effectors_w[401:411, 3, 1] += np.linspace(way, 0, 10)
    assert walking_statistics(walk)["stride_frequency"] == pytest.approx(strides / 0.22)


def test_a_step_before_settling_begins_no_stride() -> None:
    walk = swinging(walking(), [3], (100, 150), (310, 350))
    assert walking_statistics(walk)["stride_length"] is None


def test_a_fly_that_stands_has_no_gait_and_one_that_blew_up_at_once_nothing_at_all() -> None:
    still = walking_statistics(standing(1001))
    assert {name for name, value in still.items() if value is not None} == {
        "speed", "yaw_drift", "fall",
    }  # fmt: skip
    assert still["speed"] == 0.0
    at_once = walking_statistics(standing(1))
    assert at_once.pop("fall") == 0.0
    assert set(at_once.values()) == {None}


@pytest.mark.parametrize(
    ("swings", "strength"),
    [
        # of LM with RF and RH: all at once, and shifted by 10 and 20 of 40 ms, so 20 of 60 ms
        ({(1, 3, 5): (400, 440)}, 1.0),
        ({(1,): (400, 440), (3,): (410, 450), (5,): (420, 460)}, 1 / 3),
        # RM with LF and LH at once, and LM alone: the mean over both tripods
        ({(4, 0, 2): (400, 440), (1,): (480, 520)}, 0.5),
    ],
)
def test_tripod_strength_of_swings_in_and_out_of_step(swings, strength: float) -> None:
    walk = walking()
    for legs, swing in swings.items():
        walk = swinging(walk, list(legs), (250, 280), swing)
    assert walking_statistics(walk)["tripod"] == pytest.approx(strength)


def test_slip_is_the_way_of_feet_in_contact_per_way_of_the_fly() -> None:
    """From 0.2 s on the fly walks 8 mm; one foot slides 0.5 mm, and 3 mm more in the air."""
    walk = walking()
    walk.contact[500:600, 0] = False
    walk.end_effectors_w[100:, 1, 0] = 0.5  # a slip while it lands
    walk.end_effectors_w[300:401, 0, 0] = 0.005 * np.arange(101)
    walk.end_effectors_w[401:, 0, 0] = 0.5
    walk.end_effectors_w[550:, 0, 0] = 3.5
    walk.end_effectors_w[700:, 0, 2] = 1.0  # up is no slip
    assert walking_statistics(walk)["slip"] == pytest.approx(0.5 / 8.0)


def test_energy_is_the_work_per_way_after_settling() -> None:
    """40 nJ/s over 0.8 s are 32 nJ, for 8 mm."""
    walk = replace(walking(), power=np.where(np.arange(1001) <= 200, 1e6, 40.0))
    assert walking_statistics(walk)["energy"] == pytest.approx(4.0)


@pytest.mark.parametrize(("tilt", "fall"), [(74.0, 0.0), (76.0, 1.0)])
def test_a_fly_tilted_beyond_75_degrees_once_has_fallen(tilt: float, fall: float) -> None:
    walk = standing(1001)
    walk.upright[500] = np.cos(np.deg2rad(tilt))
    assert walking_statistics(walk)["fall"] == fall
