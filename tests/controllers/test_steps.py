"""Recorded steps."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from flyrl import PreprogrammedSteps
from flyrl.anatomy import LEGS
from flyrl.resources import assets_folder

TWO_PI = 2 * np.pi


@pytest.mark.parametrize("name", ["tethered", "untethered"])
def test_angles_are_those_of_a_periodic_spline(name):
    with np.load(assets_folder() / "steps" / f"{name}.npz", allow_pickle=False) as recording:
        recorded = recording["angles"]
    grid = np.linspace(0, TWO_PI, recorded.shape[2])
    phases = np.random.default_rng(0).uniform(-20, 200, 500)
    for leg, angles in zip(LEGS, recorded, strict=True):
        spline = CubicSpline(grid, angles, 1, bc_type="periodic")
        actual = PreprogrammedSteps(name).get_joint_angles(leg, phases)
        np.testing.assert_allclose(actual, spline(phases % TWO_PI), rtol=0, atol=1e-13)


def test_shape_of_angles():
    steps = PreprogrammedSteps("tethered")
    for phase, magnitude, shape in (
        (1.0, 1.0, (7,)),
        (np.zeros(4), 1.0, (7, 4)),
        (0.0, np.ones(4), (7, 4)),
        ([0.0], 1.0, (7, 1)),
        (np.zeros(0), 1.0, (7, 0)),
    ):
        assert steps.get_joint_angles("LF", phase, magnitude).shape == shape


# Times of spec section 3 over the duration, times 2π, by hand.
SWINGS = {
    ("tethered", "LF"): (0.481809, 2.005899),
    ("tethered", "RM"): (0.058997, 1.563422),
    ("tethered", "LH"): (0.058997, 1.337266),
    ("untethered", "RF"): (0.0, 2.373648),
    ("untethered", "LM"): (0.0, 2.234021),
    ("untethered", "RH"): (0.0, 1.954769),
}


@pytest.mark.parametrize(("name", "leg"), SWINGS)
def test_adhesion_is_off_in_swing_only(name, leg):
    start, end = SWINGS[name, leg]
    steps = PreprogrammedSteps(name)
    np.testing.assert_allclose(steps.swing_period[leg], (start, end), atol=1e-6)
    phases = np.array([start - 1e-3, start + 1e-3, end - 1e-3, end + 1e-3, 6.0])
    for turns in (0, 3, -2):
        adhesion = steps.get_adhesion_onoff(leg, phases + turns * TWO_PI)
        np.testing.assert_array_equal(adhesion, [True, False, False, True, True])
    assert steps.get_adhesion_onoff(leg, 6.0) is True


def test_playing_slower_changes_no_phase():
    recorded, slow = PreprogrammedSteps("untethered"), PreprogrammedSteps("untethered", 0.5)
    assert slow.duration == 0.5
    np.testing.assert_array_equal(slow.swing_ends, recorded.swing_ends)
    assert recorded.duration == pytest.approx(0.135)


def test_the_recording_cannot_be_changed():
    steps = PreprogrammedSteps("untethered")
    for array in (steps.coefficients, steps.swing_period["LF"], steps.neutral_pos["LF"]):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(TypeError):
        steps.swing_period["LF"] = np.zeros(2)


STEPS = PreprogrammedSteps("tethered")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: PreprogrammedSteps("x"), "steps must be one of 'tethered', 'untethered', got 'x'"),
        (lambda: PreprogrammedSteps("tethered", -1), "duration must be .* above 0, got -1"),
        (lambda: STEPS.get_joint_angles("LX", 0.0), "leg must be one of 'LF', .* got 'LX'"),
        (
            lambda: STEPS.get_joint_angles("LF", np.zeros((2, 2))),
            r"shape \(n,\), got shape \(2, 2\)",
        ),
        (lambda: STEPS.get_adhesion_onoff("LF", np.nan), "phase must be finite"),
        (
            lambda: STEPS.get_joint_angles("LF", np.zeros(3), np.ones(2)),
            r"must match in length, got shapes \(3,\) and \(2,\)",
        ),
    ],
)
def test_what_is_not_allowed_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
