"""The path task's own terms, on a state made by hand."""

import numpy as np
import pytest

from flyrl.tasks.path import path_deviation, path_direction_b, path_progress
from tests.tasks.test_terms import fly_state, task_state


def test_progress_along_a_path_counts_its_points() -> None:
    path = np.stack([np.arange(20) * 0.5, np.zeros(20)], axis=1).ravel()
    before = fly_state(position_w=[[1.1, 1, 0]], time=[1.0])
    after = fly_state(position_w=[[2.6, -0.5, 0]], time=[1.1])
    state = task_state(after, before, command=[path])
    assert path_progress(state) == pytest.approx(1.5)
    assert path_deviation(state) == pytest.approx(0.1 * np.hypot(0.1, 0.5))
    # 4 mm beyond the nearest point, (2.5, 0)
    expected = np.array([6.5 - 2.6, 0.5])
    np.testing.assert_allclose(path_direction_b(state, 4.0)[0], expected / np.hypot(*expected))
