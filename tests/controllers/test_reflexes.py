"""The reflexes for a loop in Python; `test_controllers` holds the kernel to the specification."""

import numpy as np
import pytest

from flyrl.controllers import Hybrid, Reflexes
from flyrl.controllers.reflexes import NO_LEG, retraction_leg

FORWARD = np.array([1.0, 0.0, 0.0])
CURRENT = Hybrid()
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
        ([-1, -1.3, -1, -1, -1, -1.4], 5),  # only the second deepest is near: the third decides
        ([-1.3, -1.3, -1, -1, -1, -1.3], NO_LEG),  # three stand equally deep
        ([-1.32, -1.3, -1.28, -1, -1, -1], NO_LEG),
    ],
)
def test_the_deepest_leg_below_the_thorax_is_retracted_if_it_is_alone(heights, leg):
    assert retraction_leg(7.0, np.array(heights) + 7.0, 0.05) == leg


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


@pytest.mark.parametrize(("timestep", "num_steps"), [(1e-4, 20), (3e-4, 7), (6e-4, 3), (1e-3, 2)])
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


def test_current_corrections_are_capped_and_depend_on_the_phase():
    reflexes = run(current(), 2000, LF_IN_HOLE)
    assert reflexes.retraction[0] == pytest.approx(160)
    peak = CURRENT.load_steps().swing_ends / 2
    np.testing.assert_allclose(reflexes.net_corrections(peak), [0.8 * 80, 0, 0, 0, 0, 0])


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
        ((np.nan, LEVEL, NO_FORCE, FORWARD), "thorax_z must be finite"),
    ],
)
def test_observations_are_checked(observation, message):
    with pytest.raises(ValueError, match=message):
        current().step(*observation)
