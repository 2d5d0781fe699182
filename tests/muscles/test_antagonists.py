"""Antagonist pairs: from a torque that is asked for to neurons, and back to a torque."""

import numpy as np
import pytest

from flyrl.muscles.muscle import move_by_muscles, pull

RECRUITMENT = np.array([0.1, 0.3, 0.6, 1.0])
STRENGTHS = np.array([10.0, 20.0])


@pytest.mark.parametrize(
    ("asked", "tensions", "torque"),
    [
        # 10 T - 20 x 0.1: of 0.1, 0.3, 0.6, 1 the last comes nearest to (4 + 2) / 10 = 0.6, ...
        (4.0, (0.6, 0.1), 4.0),
        (4.9, (0.6, 0.1), 4.0),
        (6.1, (1.0, 0.1), 8.0),
        (100.0, (1.0, 0.1), 8.0),
        # ... to -(20 T - 10 x 0.1) it is (9 + 1) / 20 = 0.5
        (-9.0, (0.1, 0.6), -11.0),
        (-6.9, (0.1, 0.3), -5.0),
        (-100.0, (0.1, 1.0), -19.0),
    ],
)
def test_a_pair_comes_as_near_to_a_torque_as_its_neurons_allow(asked, tensions, torque):
    tension = np.zeros(2)
    assert pull(RECRUITMENT, STRENGTHS, asked, tension) == pytest.approx(torque)
    np.testing.assert_allclose(tension, tensions)


def test_a_muscle_without_strength_pulls_nothing():
    tension = np.zeros(2)
    assert pull(RECRUITMENT, np.zeros(2), 3.0, tension) == 0.0
    assert np.isfinite(tension).all()


def test_joints_are_moved_as_their_servos_would_move_them():
    many = np.arange(1, 1001) / 1000
    tension, torque = np.zeros((3, 2)), np.zeros(5)
    move_by_muscles(
        np.array([40.0, 40.0, 0.0]),
        np.full((3, 2), 10.0),
        many,
        np.array([0.1, 0.2, 0.3]),
        np.array([0.2, 0.1, 3.0]),
        tension,
        torque,
    )
    # 40 x 0.1, as near as a thousandth of 10
    np.testing.assert_allclose(torque, [4.0, -4.0, 0.0, 0.0, 0.0], atol=0.011)
    np.testing.assert_allclose(tension[:, 0] - tension[:, 1], torque[:3] / 10)
