"""The retraction and stumbling reflexes, against numbers worked out by hand."""

import dataclasses

import numpy as np
import pytest

from flyrl.controllers.hybrid_controller import Reflexes
from flyrl.controllers.reflexes import (
    CLASSIC,
    CURRENT,
    NO_LEG,
    phase_gain,
    retraction_leg,
    stumbles,
)
from flyrl.controllers.steps import PreprogrammedSteps

FORWARD = np.array([1.0, 0.0, 0.0])
SENSORS = CURRENT.stumbling_sensors()
LEVEL = np.full(6, -1.0)
LF_IN_HOLE = np.array([-2.0, -1.0, -1.0, -1.0, -1.0, -1.0])
NO_FORCE = np.zeros((36, 3))
SWING_ENDS = PreprogrammedSteps("untethered").swing_ends


def lf_pushed_back():
    forces = np.zeros((36, 3))
    forces[1] = [-1.5, 0, 0]  # LFTarsus1
    return forces


def run(reflexes, num_steps, heights=LEVEL, forces=NO_FORCE):
    for _ in range(num_steps):
        reflexes.step(0.0, heights, forces, FORWARD)
    return reflexes


def current(timestep=1e-4):
    return Reflexes(timestep, CURRENT, SWING_ENDS)


@pytest.mark.parametrize(
    ("heights", "leg"),
    [
        ([-1, -1, -1, -1, -1, -1], NO_LEG),
        ([-1, -1, -1, -1.051, -1, -1], 3),
        ([-1, -1, -1, -1.049, -1, -1], NO_LEG),
        ([-1, -1.3, -1, -1, -1, -1.4], 5),  # only the second deepest is near: the third decides
        ([-1.3, -1.3, -1, -1, -1, -1.3], NO_LEG),  # three stand equally deep
        ([-1.32, -1.3, -1.28, -1, -1, -1], NO_LEG),
    ],
)
def test_the_deepest_leg_is_retracted_if_it_is_alone(heights, leg):
    assert retraction_leg(0.0, np.array(heights), 0.05) == leg


def test_depth_is_measured_from_the_thorax():
    heights = np.array([-1.0, -1.0, -1.2, -1.0, -1.0, -1.0]) + 7
    assert retraction_leg(7.0, heights, 0.05) == 2


@pytest.mark.parametrize(
    ("segment", "counts"), [(0, True), (1, True), (2, True), (3, False), (4, False), (5, False)]
)
def test_tibia_and_upper_tarsus_stumble(segment, counts):
    forces = np.zeros((36, 3))
    forces[6 * 4 + segment, 0] = -2
    assert stumbles(forces, FORWARD, 4, -1.0, SENSORS) is counts
    assert not stumbles(forces, FORWARD, 3, -1.0, SENSORS)


@pytest.mark.parametrize(("force", "counts"), [(-1.01, True), (-1.0, False), (5.0, False)])
def test_only_a_push_against_the_heading_counts(force, counts):
    forces = np.zeros((36, 3))
    forces[0] = [0.0, force, -9.0]
    assert stumbles(forces, np.array([0.0, 1.0, 0.0]), 0, -1.0, SENSORS) is counts


def test_retraction_grows_and_decays_at_its_rates():
    reflexes = run(current(), 50, LF_IN_HOLE)
    np.testing.assert_allclose(reflexes.retraction, [50 * 800 * 1e-4, 0, 0, 0, 0, 0])
    run(reflexes, 30)
    assert reflexes.retraction[0] == pytest.approx(4.0 - 30 * 700 * 1e-4)
    run(reflexes, 100)
    assert reflexes.retraction[0] == 0


def test_stumbling_grows_and_decays_at_its_rates():
    reflexes = run(current(), 50, forces=lf_pushed_back())
    np.testing.assert_allclose(reflexes.stumbling, [50 * 2200 * 1e-4, 0, 0, 0, 0, 0])
    run(reflexes, 30)
    assert reflexes.stumbling[0] == pytest.approx(11.0 - 30 * 1800 * 1e-4)
    run(reflexes, 100)
    assert reflexes.stumbling[0] == 0


def test_classic_rates():
    reflexes = run(Reflexes(1e-4, CLASSIC, SWING_ENDS), 60, LF_IN_HOLE, lf_pushed_back())
    assert reflexes.retraction[0] == pytest.approx(60 * 0.05)
    assert reflexes.stumbling[0] == pytest.approx(60 * 0.2)
    run(reflexes, 30)
    assert reflexes.retraction[0] == pytest.approx(3 - 1)  # 30 steps of 1/30
    assert reflexes.stumbling[0] == pytest.approx(12 - 1.5)


def test_current_retraction_ends_stumbling():
    reflexes = run(current(), 50, forces=lf_pushed_back())
    run(reflexes, 1, LF_IN_HOLE, lf_pushed_back())
    assert reflexes.stumbling[0] == 0
    assert reflexes.retraction[0] == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("timestep", "num_steps"), [(1e-4, 20), (2e-4, 10), (5e-4, 4), (3e-4, 7), (6e-4, 3), (1e-3, 2)]
)
def test_a_strongly_retracted_leg_persists_for_two_milliseconds(timestep, num_steps):
    reflexes = current(timestep)
    while reflexes.retraction[0] <= 20:
        run(reflexes, 1, LF_IN_HOLE)
    run(reflexes, 1, LF_IN_HOLE)  # triggers, and is the first of the persisting steps
    growing = 1
    before = reflexes.retraction[0]
    while run(reflexes, 1).retraction[0] > before:
        before = reflexes.retraction[0]
        growing += 1
    assert growing == num_steps


def test_a_weakly_retracted_leg_does_not_persist():
    reflexes = run(current(), 249, LF_IN_HOLE)  # 19.92
    before = reflexes.retraction[0]
    run(reflexes, 1)
    assert reflexes.retraction[0] == pytest.approx(before - 0.07)


def test_classic_legs_do_not_persist():
    reflexes = run(Reflexes(1e-4, CLASSIC, SWING_ENDS), 1000, LF_IN_HOLE)  # 50
    run(reflexes, 1)
    assert reflexes.retraction[0] == pytest.approx(50 - 1 / 30)


def test_gain_by_hand():
    # Swing end 2: points at 0, 1, 2 + π/4 = 2.785, (2 + 2π)/2 = 4.142, 2π.
    phases = CURRENT.gain_phases(np.full(6, 2.0))[0]
    gain = np.array(CURRENT.gain)
    np.testing.assert_allclose(phases, [0, 1, 2.785398, 4.141593, 6.283185], atol=1e-6)
    assert phase_gain(0.0, phases, gain) == 0
    assert phase_gain(0.5, phases, gain) == pytest.approx(0.4)
    assert phase_gain(1.0, phases, gain) == pytest.approx(0.8)
    assert phase_gain((1 + phases[2]) / 2, phases, gain) == pytest.approx(0.4)
    assert phase_gain(phases[2], phases, gain) == pytest.approx(0, abs=1e-15)
    assert phase_gain(phases[3], phases, gain) == pytest.approx(-0.1)
    assert phase_gain((phases[3] + phases[4]) / 2, phases, gain) == pytest.approx(-0.05)
    assert phase_gain(phases[4], phases, gain) == pytest.approx(0, abs=1e-15)


def test_classic_has_no_gain():
    phases = CLASSIC.gain_phases(SWING_ENDS)[0]
    for theta in np.linspace(0, 2 * np.pi, 50):
        assert phase_gain(theta, phases, np.array(CLASSIC.gain)) == 1


def test_correction_is_capped():
    reflexes = run(current(), 2000, LF_IN_HOLE)
    assert reflexes.retraction[0] == pytest.approx(160)
    peak = SWING_ENDS / 2
    np.testing.assert_allclose(reflexes.net_corrections(peak), [0.8 * 80, 0, 0, 0, 0, 0])


def test_classic_correction_is_not_capped():
    reflexes = run(Reflexes(1e-4, CLASSIC, SWING_ENDS), 2000, LF_IN_HOLE)
    assert reflexes.net_corrections(np.zeros(6))[0] == pytest.approx(100)


def test_retraction_comes_before_stumbling():
    reflexes = run(Reflexes(1e-4, CLASSIC, SWING_ENDS), 60, LF_IN_HOLE, lf_pushed_back())
    assert reflexes.net_corrections(np.zeros(6))[0] == pytest.approx(3)  # not 12


def test_stumbling_corrects_where_nothing_retracts():
    reflexes = run(Reflexes(1e-4, CLASSIC, SWING_ENDS), 60, forces=lf_pushed_back())
    assert reflexes.net_corrections(np.zeros(6))[0] == pytest.approx(12)


def test_current_right_legs_mirror_left_ones():
    vectors = CURRENT.leg_vectors()
    np.testing.assert_array_equal(vectors[1], [-0.015, 0.001, 0.025, -0.02, 0, -0.02, 0])
    np.testing.assert_array_equal(vectors[4], [-0.015, -0.001, -0.025, -0.02, 0, -0.02, 0])


def test_classic_right_legs_do_as_left_ones():
    vectors = CLASSIC.leg_vectors()
    np.testing.assert_array_equal(vectors[:3], vectors[3:])
    np.testing.assert_array_equal(vectors[3], [0, 0, 0, -0.02, 0, 0.016, 0])


def test_amounts_handed_out_before_do_not_change():
    reflexes = current()
    before = reflexes.retraction
    run(reflexes, 1, LF_IN_HOLE)
    assert not before.any()
    assert reflexes.retraction.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"front": (1.0, 2.0)}, r"front must have shape \(7,\), got shape \(2,\)"),
        ({"gain": (0.0,)}, r"gain must have shape \(5,\)"),
        ({"retraction_rates": (-1, 1)}, "retraction_rates must be at least 0"),
        ({"stumbling_rates": (1,)}, r"stumbling_rates must have shape \(2,\)"),
        ({"persistence_s": -1.0}, "persistence_s must be .* at least 0, got -1.0"),
        ({"retraction_margin": -0.05}, "retraction_margin must be .* at least 0, got -0.05"),
        ({"cap": -80.0}, "cap must be a number of at least 0, or inf, got -80.0"),
        ({"stumbling_force": np.nan}, "stumbling_force must be finite, got nan"),
    ],
)
def test_parameters_are_checked(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(CURRENT, **change)


@pytest.mark.parametrize(
    ("timestep", "swing_ends", "message"),
    [
        (-1e-4, SWING_ENDS, "timestep must be a finite number above 0, got -0.0001"),
        (1e-4, SWING_ENDS[:5], r"swing_ends must have shape \(6,\), got shape \(5,\)"),
    ],
)
def test_arguments_are_checked(timestep, swing_ends, message):
    with pytest.raises(ValueError, match=message):
        Reflexes(timestep, CURRENT, swing_ends)


@pytest.mark.parametrize(
    ("observation", "message"),
    [
        ((0.0, LEVEL[:5], NO_FORCE, FORWARD), r"end_effector_z must have shape \(6,\)"),
        ((0.0, LEVEL, NO_FORCE[:35], FORWARD), r"contact_forces_w must have shape \(36, 3\)"),
        ((0.0, LEVEL, NO_FORCE, FORWARD[:2]), r"heading_w must have shape \(3,\)"),
        ((np.nan, LEVEL, NO_FORCE, FORWARD), "thorax_z must be finite"),
    ],
)
def test_observations_are_checked(observation, message):
    with pytest.raises(ValueError, match=message):
        current().step(*observation)
