from dataclasses import replace

import numpy as np
import pytest

from flyrl.evaluation import EvaluationConfig, make_entrants, measure_drive_map, measure_steering
from flyrl.evaluation.drive_map import mean_and_error
from flyrl.tasks import TASKS


def test_equal_drives_walk_straight_and_the_stronger_side_turns_the_fly_to_the_other():
    config = EvaluationConfig(physics="fast", num_threads=1)
    found = measure_drive_map(config, config.terrain_configs[0], size=3, starts=2)
    np.testing.assert_allclose(found.drives, [-0.5, 0.5, 1.5])
    assert np.abs(np.diag(found.yaw_rate_deg_s)).max() < 20
    speeds = np.diag(found.speed_mm_s)
    assert speeds[2] > 2 * speeds[1] > 4
    assert (found.speed_error_mm_s > 0).all()  # starts differ in their phases
    left_stronger, right_stronger = found.yaw_rate_deg_s[2, 1], found.yaw_rate_deg_s[1, 2]
    assert left_stronger < -50 < 50 < right_stronger
    assert right_stronger == pytest.approx(-left_stronger, rel=0.2)


def test_mean_and_standard_error_of_the_flies_that_walked():
    values = np.array([[[1.0, 3.0, 5.0, 99.0]]])
    mean, error = mean_and_error(values, values < 90)
    assert mean[0, 0] == 3
    assert error[0, 0] == pytest.approx(2 / np.sqrt(3))
    assert np.isnan(mean_and_error(values, values < 4)[0]).all()


def config(task="target", **settings):
    return EvaluationConfig(task=task, episodes=2, physics="fast", num_threads=1, **settings)


def steering_of(config):
    return measure_steering(config, make_entrants(config), config.terrain_configs[0])


def test_those_are_asked_that_see_the_bearing_and_drive_the_far_legs_more():
    asked = config(policies=("target-flat",), controllers=("pursuit", "cpg"))
    steering = steering_of(asked)
    assert list(steering.drives) == ["target-flat", "pursuit"]  # cpg sees nothing
    for drives in steering.drives.values():
        assert drives.shape == (2, len(steering.bearings_deg), 2)
        left, right = drives.mean(axis=0).T
        to_left, to_right = steering.bearings_deg == 60, steering.bearings_deg == -60
        assert right[to_left] > left[to_left] + 0.1
        assert left[to_right] > right[to_right] + 0.1
    # straight ahead: full drive of the quick setting to both
    ahead = steering.drives["pursuit"][:, steering.bearings_deg == 0]
    np.testing.assert_allclose(ahead, 1.5, atol=1e-6)


def unmarked():
    """Target, whose bearing has its name but not its mark."""
    first, *others = TASKS["target"]().observation
    return replace(TASKS["target"](), observation=(replace(first, is_bearing=False), *others))


@pytest.mark.parametrize(
    ("task", "law"),
    [("velocity", "open_loop"), ("target_goal", "pursuit"), (unmarked(), "pursuit")],
)
def test_a_task_without_a_bearing_has_none(task, law):
    assert steering_of(config(task, controllers=(law,))) is None
