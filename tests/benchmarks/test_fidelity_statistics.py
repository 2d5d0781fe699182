"""Walking statistics of trajectories made by hand: 1 ms apart, numbers worked out on paper."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fidelity.statistics import Trajectory, walking_statistics


def standing(samples: int) -> Trajectory:
    """A fly that stands at the origin, facing +y, all feet on the ground, at no power."""
    return Trajectory(
        time=0.001 * np.arange(samples),
        position_w=np.zeros((samples, 3)),
        yaw=np.full(samples, np.pi / 2),
        upright=np.ones(samples),
        end_effectors_w=np.zeros((samples, 6, 3)),
        contact=np.ones((samples, 6), dtype=bool),
        power=np.zeros(samples),
    )


def walking(samples: int = 1001, speed: float = 10.0) -> Trajectory:
    """The same, moving along +y at `speed` mm/s."""
    position_w = np.zeros((samples, 3))
    position_w[:, 1] = speed * 0.001 * np.arange(samples)
    return replace(standing(samples), position_w=position_w)


def swinging(walk: Trajectory, legs: list[int], *swings: tuple[int, int]) -> Trajectory:
    """The same; in each swing these feet go 1 mm forward from the thorax, before it 1 mm back.

    A leg's first swing begins at its first posterior extreme, and so ends its first step's stance.
    """
    along = np.zeros(len(walk.time))
    knots = [(0, 0.0)]
    for start, end in swings:
        knots += [(start, -1.0), (end, 0.0)]
    knots += [(len(walk.time) - 1, -1.0)]
    samples, values = zip(*knots, strict=True)
    along = np.interp(np.arange(len(walk.time)), samples, values)
    feet_w = walk.end_effectors_w.copy()
    feet_w[:, legs, :2] = walk.position_w[:, None, :2]
    feet_w[:, legs, 1] += along[:, None]
    return replace(walk, end_effectors_w=feet_w)


def test_speed_and_straightness_of_a_right_angle() -> None:
    """0.6 s along x and 0.8 s along y at 5 mm/s: 3 and 4 mm walked, 5 mm covered in 1.4 s.

    Height counts for neither.
    """
    walk = standing(1401)
    walk.position_w[:, 2] = np.linspace(2.0, 0.0, 1401)
    walk.position_w[:, 0] = np.minimum(0.005 * np.arange(1401), 3.0)
    walk.position_w[:, 1] = np.maximum(0.005 * np.arange(1401) - 3.0, 0.0)
    figures = walking_statistics(walk)
    assert figures["speed"] == pytest.approx(5.0 / 1.4)
    assert figures["straightness"] == pytest.approx(5.0 / 7.0)


def test_a_sway_shorter_than_the_sampling_of_the_path_is_no_way() -> None:
    """Swaying by 1 mm at 10 Hz, on the path's points every 0.1 s by nothing."""
    walk = walking()
    walk.position_w[:, 0] = np.sin(2 * np.pi * 10 * walk.time)
    assert walking_statistics(walk)["straightness"] == pytest.approx(1.0)


def test_yaw_drift_counts_turns_across_the_wrap() -> None:
    """From 170 degrees, 40 degrees left in 0.5 s."""
    walk = standing(501)
    turned = np.deg2rad(170 + np.linspace(0, 40, 501))
    walk = replace(walk, yaw=np.arctan2(np.sin(turned), np.cos(turned)))
    assert walking_statistics(walk)["yaw_drift"] == pytest.approx(80.0)


def test_strides_of_one_leg() -> None:
    """Anterior extremes at 0.35, 0.45 and 0.57 s of a fly at 10 mm/s: strides of 1.0 and 1.2 mm.

    The foot loses contact for 40 and 30 ms within these 220 ms, and for 50 ms outside.
    """
    walk = swinging(walking(), [3], (310, 350), (410, 450), (540, 570))
    for start, end in ((300, 350), (410, 450), (540, 570)):
        walk.contact[start:end, 3] = False
    figures = walking_statistics(walk)
    assert figures["stride_length"] == pytest.approx(1.1)
    assert figures["stride_frequency"] == pytest.approx(2 / 0.22)
    assert figures["duty_factor"] == pytest.approx(150 / 220)


def test_steps_are_told_along_the_heading() -> None:
    """Heading along +x, the same feet move sideways and make no step."""
    walk = swinging(walking(), [3], (310, 350), (410, 450), (540, 570))
    assert walking_statistics(replace(walk, yaw=np.zeros(1001)))["stride_length"] is None


def test_a_twitch_is_no_step() -> None:
    """Of 0.15 mm no, of 0.25 mm yes: it ends at 0.4 s, so there are 3 strides up to 0.57 s."""
    walk = swinging(walking(), [3], (310, 350), (440, 450), (540, 570))
    small, large = (replace(walk, end_effectors_w=walk.end_effectors_w.copy()) for _ in range(2))
    # the foot goes back by 1 mm in 90 ms all the while
    for each, way in ((small, 0.15), (large, 0.25)):
        each.end_effectors_w[390:401, 3, 1] += np.linspace(0, way + 1 / 9, 11)
        each.end_effectors_w[401:411, 3, 1] += np.linspace(way, 0, 10)
    assert walking_statistics(small)["stride_frequency"] == pytest.approx(2 / 0.22)
    assert walking_statistics(large)["stride_frequency"] == pytest.approx(3 / 0.22)


def test_a_step_before_settling_begins_no_stride() -> None:
    walk = swinging(walking(), [3], (100, 150), (310, 350))
    assert walking_statistics(walk)["stride_length"] is None


def test_a_fly_that_stands_has_no_gait() -> None:
    figures = walking_statistics(standing(1001))
    assert figures["speed"] == 0.0
    for name in ("straightness", "stride_length", "stride_frequency", "duty_factor", "tripod"):
        assert figures[name] is None
    assert figures["slip"] is None
    assert figures["energy"] is None


def test_tripod_strength_of_swings_in_and_out_of_step() -> None:
    """LM with RF and RH: all at once, 1; shifted by 10 and 20 of 40 ms, 20 of 60 ms."""
    together = swinging(walking(), [1, 3, 5], (250, 280), (400, 440))
    assert walking_statistics(together)["tripod"] == pytest.approx(1.0)
    apart = swinging(walking(), [1], (250, 280), (400, 440))
    apart = swinging(apart, [3], (250, 280), (410, 450))
    apart = swinging(apart, [5], (250, 280), (420, 460))
    assert walking_statistics(apart)["tripod"] == pytest.approx(1 / 3)


def test_tripod_strength_is_the_mean_over_both_tripods() -> None:
    """RM with LF and LH at once: 1; LM alone: 0; and so 1/2."""
    walk = swinging(walking(), [4, 0, 2], (250, 280), (400, 440))
    walk = swinging(walk, [1], (300, 330), (480, 520))
    assert walking_statistics(walk)["tripod"] == pytest.approx(0.5)


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


def test_an_episode_that_blew_up_at_once_has_no_figures_but_no_fall_either() -> None:
    figures = walking_statistics(standing(1))
    assert figures["fall"] == 0.0
    assert all(value is None for name, value in figures.items() if name != "fall")
