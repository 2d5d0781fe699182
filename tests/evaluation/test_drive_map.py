import numpy as np
import pytest

from flyrl.evaluation import EvaluationConfig, measure_drive_map


@pytest.fixture(scope="module")
def drive_map():
    config = EvaluationConfig(physics="fast", num_threads=1)
    return measure_drive_map(config, config.terrain_configs[0], size=3)


def test_equal_drives_walk_straight_the_faster_the_stronger(drive_map):
    # at -0.5, 0.5 and 1.5
    np.testing.assert_allclose(drive_map.drives, [-0.5, 0.5, 1.5])
    assert np.abs(np.diag(drive_map.yaw_rate_deg_s)).max() < 20
    speeds = np.diag(drive_map.speed_mm_s)
    assert speeds[2] > 2 * speeds[1] > 4


def test_the_stronger_side_turns_the_fly_to_the_other(drive_map):
    left_stronger, right_stronger = drive_map.yaw_rate_deg_s[2, 1], drive_map.yaw_rate_deg_s[1, 2]
    assert left_stronger < -50 < 50 < right_stronger
    assert right_stronger == pytest.approx(-left_stronger, rel=0.2)
