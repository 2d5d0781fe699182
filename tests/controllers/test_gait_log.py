"""Which legs are on the ground; `tests/simulation/test_gait_log` holds the log to the steps."""

import numpy as np

from flyrl.controllers.gait_log import CONTACT_THRESHOLD, grounded_legs


def test_a_leg_is_on_the_ground_when_the_sum_of_its_forces_is_above_the_threshold():
    forces_w = np.zeros((2, 36, 3))
    forces_w[1, 0] = (0.6, 0.0, 0.0)  # LF: 0.6 and 0.8 at right angles are 1, which is not above
    forces_w[1, 5] = (0.0, 0.8, 0.0)
    forces_w[1, 6] = (0.0, 0.0, 1.01 * CONTACT_THRESHOLD)  # LM
    forces_w[1, 12:14] = [(0.0, 0.0, 3.0), (0.0, 0.0, -2.5)]  # LH: one pushes, one pulls
    is_grounded = np.full((2, 6), np.nan)
    for forces, row in zip(forces_w, is_grounded, strict=True):
        grounded_legs(forces, row)
    np.testing.assert_array_equal(is_grounded, [[0] * 6, [0, 1, 0, 0, 0, 0]])
