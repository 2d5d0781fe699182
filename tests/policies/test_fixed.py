import numpy as np
import pytest

from flyrl.policies import ConstantDrive, OpenLoop, Pursuit, PursuitOfGoal


def _normalised(drive):
    return drive - 0.5


def test_constant_drive_single_and_batch():
    policy = ConstantDrive(1.0, 0.25, _normalised)
    np.testing.assert_array_equal(policy.predict(np.zeros(7))[0], [0.5, -0.25])
    np.testing.assert_array_equal(policy.predict(np.zeros((3, 7)))[0], [[0.5, -0.25]] * 3)


@pytest.mark.parametrize(
    ("forward", "left", "drive"),
    [
        (1.0, 0.0, (1.0, 1.0)),
        (np.cos(0.1), np.sin(0.1), (0.9, 1.1)),
        (np.cos(0.1), -np.sin(0.1), (1.1, 0.9)),
        (0.0, 1.0, (0.2, 1.2)),
        (0.0, -1.0, (1.2, 0.2)),
    ],
)
def test_pursuit_turns_towards_the_target(forward, left, drive):
    policy = Pursuit(slice(1, 3), lambda drive: drive, gain=1.0)
    action, _ = policy.predict([99.0, forward, left])
    np.testing.assert_allclose(action, drive, rtol=1e-6)


def test_pursuit_of_a_goal_turns_towards_it():
    policy = PursuitOfGoal(slice(0, 2), slice(2, 4), slice(4, 6), lambda drive: drive)
    facing_y = (0.0, 1.0)
    ahead, left, right = (1.0, 5.0), (0.0, 2.0), (3.0, 2.0)  # of a fly at (1, 2)
    drives = policy.predict([[1.0, 2.0, *goal, *facing_y] for goal in (ahead, left, right)])[0]
    np.testing.assert_allclose(drives, [(1.0, 1.0), (0.2, 1.2), (1.2, 0.2)], rtol=1e-6)


def test_pursuit_in_batches():
    policy = Pursuit(slice(0, 2), _normalised)
    observations = np.random.default_rng(0).normal(size=(20, 5))
    singles = [policy.predict(observation)[0] for observation in observations]
    np.testing.assert_array_equal(policy.predict(observations)[0], singles)


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "drive"),
    [
        (13.0, 0.0, (1.0, 1.0)),
        (6.5, 0.0, (0.5, 0.5)),
        (6.5, 3.2, (0.0, 1.0)),
        (0, -3.2, (0.5, -0.5)),
    ],
)
def test_open_loop_answers_speed_and_yaw_rate(speed, yaw_rate, drive):
    policy = OpenLoop(slice(1, 3), lambda drive: drive)
    action, _ = policy.predict([99.0, speed / 20, yaw_rate / 10])
    np.testing.assert_allclose(action, drive, atol=1e-6)
    batch, _ = policy.predict(np.array([[99.0, speed / 20, yaw_rate / 10]] * 3))
    np.testing.assert_array_equal(batch, [action] * 3)
