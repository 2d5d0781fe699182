"""The retraction and stumbling reflexes, against numbers worked out by hand."""

import numpy as np
import pytest

from flyrl.controllers import Hybrid, Reflexes
from flyrl.controllers.reflexes import NO_LEG, phase_gain, retraction_leg, stumbles

FORWARD = np.array([1.0, 0.0, 0.0])
CURRENT, CLASSIC = Hybrid(), Hybrid(reflexes="classic")
FIGURES = CURRENT.parameters(1e-4)
LEVEL = np.full(6, -1.0)
LF_IN_HOLE = np.array([-2.0, -1.0, -1.0, -1.0, -1.0, -1.0])
NO_FORCE = np.zeros((36, 3))
LF_PUSHED_BACK = np.zeros((36, 3))
LF_PUSHED_BACK[1, 0] = -1.5  # LFTarsus1


def run(reflexes, num_steps, heights=LEVEL, forces=NO_FORCE):
    for _ in range(num_steps):
        reflexes.step(0.0, heights, forces, FORWARD)
    return reflexes


def current(timestep=1e-4):
    return Reflexes(timestep, CURRENT)


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
@pytest.mark.parametrize("thorax_z", [0.0, 7.0])
def test_the_deepest_leg_below_the_thorax_is_retracted_if_it_is_alone(heights, leg, thorax_z):
    assert retraction_leg(thorax_z, np.array(heights) + thorax_z, 0.05) == leg


@pytest.mark.parametrize(
    ("segment", "counts"), [(0, True), (1, True), (2, True), (3, False), (4, False), (5, False)]
)
def test_tibia_and_upper_tarsus_stumble(segment, counts):
    forces = np.zeros((36, 3))
    forces[6 * 4 + segment, 0] = -2
    assert stumbles(forces, FORWARD, 4, -1.0, FIGURES["stumbling_sensors"]) is counts
    assert not stumbles(forces, FORWARD, 3, -1.0, FIGURES["stumbling_sensors"])


@pytest.mark.parametrize(("force", "counts"), [(-1.01, True), (-1.0, False), (5.0, False)])
def test_only_a_push_against_the_heading_counts(force, counts):
    forces = np.zeros((36, 3))
    forces[0] = [0.0, force, -9.0]
    heading_w = np.array([0.0, 1.0, 0.0])
    assert stumbles(forces, heading_w, 0, -1.0, FIGURES["stumbling_sensors"]) is counts


@pytest.mark.parametrize(
    ("reflex", "trouble", "growth", "decay"),
    [
        ("retraction", {"heights": LF_IN_HOLE}, 800, 700),
        ("stumbling", {"forces": LF_PUSHED_BACK}, 2200, 1800),
    ],
)
def test_a_reflex_grows_and_decays_at_its_rates_to_0(reflex, trouble, growth, decay):
    reflexes = run(current(), 50, **trouble)
    np.testing.assert_allclose(getattr(reflexes, reflex), [50 * growth * 1e-4, 0, 0, 0, 0, 0])
    run(reflexes, 20)
    assert getattr(reflexes, reflex)[0] == pytest.approx((50 * growth - 20 * decay) * 1e-4)
    run(reflexes, 100)
    assert getattr(reflexes, reflex)[0] == 0


def test_classic_rates_and_that_retraction_comes_before_stumbling():
    reflexes = run(Reflexes(1e-4, CLASSIC), 60, LF_IN_HOLE, LF_PUSHED_BACK)
    assert reflexes.retraction[0] == pytest.approx(60 * 0.05)
    assert reflexes.stumbling[0] == pytest.approx(60 * 0.2)
    assert reflexes.net_corrections(np.zeros(6))[0] == pytest.approx(3)  # not 12
    run(reflexes, 30)
    assert reflexes.retraction[0] == pytest.approx(3 - 1)  # 30 steps of 1/30
    assert reflexes.stumbling[0] == pytest.approx(12 - 1.5)


def test_current_retraction_ends_stumbling():
    reflexes = run(current(), 50, forces=LF_PUSHED_BACK)
    run(reflexes, 1, LF_IN_HOLE, LF_PUSHED_BACK)
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


@pytest.mark.parametrize(
    ("controller", "num_steps", "reached", "decay"),
    [(CURRENT, 249, 19.92, 0.07), (CLASSIC, 1000, 50, 1 / 30)],
)
def test_weakly_retracted_and_classic_legs_do_not_persist(controller, num_steps, reached, decay):
    reflexes = run(Reflexes(1e-4, controller), num_steps, LF_IN_HOLE)
    assert reflexes.retraction[0] == pytest.approx(reached)
    assert run(reflexes, 1).retraction[0] == pytest.approx(reached - decay)


def test_gain_by_hand():
    # The swing of RH ends at 1.954769: 1/2, + π/4, (+ 2π)/2.
    phases, gain = FIGURES["gain_phases"][5], FIGURES["gain"]
    np.testing.assert_allclose(phases, [0, 0.977384, 2.740167, 4.118977, 6.283185], atol=1e-6)
    np.testing.assert_array_equal(gain, [0, 0.8, 0, -0.1, 0])
    points = [0.0, phases[1] / 2, phases[1], (phases[1] + phases[2]) / 2, *phases[2:]]
    expected = [0, 0.4, 0.8, 0.4, 0, -0.1, 0]
    found = [phase_gain(theta, phases, gain) for theta in points]
    np.testing.assert_allclose(found, expected, atol=1e-15)
    assert phase_gain((phases[3] + phases[4]) / 2, phases, gain) == pytest.approx(-0.05)


def test_current_corrections_are_capped_and_depend_on_the_phase():
    reflexes = run(current(), 2000, LF_IN_HOLE)
    assert reflexes.retraction[0] == pytest.approx(160)
    peak = CURRENT.load_steps().swing_ends / 2
    np.testing.assert_allclose(reflexes.net_corrections(peak), [0.8 * 80, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("phase", np.linspace(0, 2 * np.pi, 7))
def test_classic_corrections_are_neither(phase):
    reflexes = run(Reflexes(1e-4, CLASSIC), 2000, LF_IN_HOLE)
    assert reflexes.net_corrections(np.full(6, phase))[0] == pytest.approx(100)


def test_stumbling_corrects_where_nothing_retracts():
    reflexes = run(Reflexes(1e-4, CLASSIC), 60, forces=LF_PUSHED_BACK)
    assert reflexes.net_corrections(np.zeros(6))[0] == pytest.approx(12)


@pytest.mark.parametrize(
    ("controller", "leg", "vector"),
    [
        (CURRENT, 1, [-0.015, 0.001, 0.025, -0.02, 0, -0.02, 0]),
        (CURRENT, 4, [-0.015, -0.001, -0.025, -0.02, 0, -0.02, 0]),
        (CLASSIC, 0, [0, 0, 0, -0.02, 0, 0.016, 0]),
        (CLASSIC, 3, [0, 0, 0, -0.02, 0, 0.016, 0]),
    ],
)
def test_only_current_right_legs_mirror_left_ones(controller, leg, vector):
    np.testing.assert_array_equal(Reflexes(1e-4, controller).vectors[leg], vector)


def test_amounts_handed_out_before_do_not_change():
    reflexes = current()
    before = reflexes.retraction
    run(reflexes, 1, LF_IN_HOLE)
    assert not before.any()
    assert reflexes.retraction.any()


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
