"""The grid of drives, how two grids are compared, and random drives."""

import numpy as np
import pytest

from benchmarks.fidelity.stability import outcomes
from benchmarks.fidelity.turning import relative_difference, slope, yaw_rates

GRID = np.array([[0.0, 100.0], [-100.0, 0.0]])


def test_the_difference_is_relative_to_the_whole_grid_and_the_slope_is_the_common_factor() -> None:
    differences = [relative_difference(factor * GRID, GRID) for factor in (1.1, 1, -1)]
    assert differences == pytest.approx([0.1, 0.0, 2.0])
    assert slope(1.2 * GRID, GRID) == pytest.approx(1.2)


@pytest.mark.slow
def test_flies_turn_towards_the_weaker_side_and_zero_drive_does_not_turn() -> None:
    """Left drive -0.5, 0.5, 1.5 by right drive."""
    rates, falls = yaw_rates("fast", 3, conditions=2, seconds=0.5)
    assert rates[1, 2] > 50
    assert rates[2, 1] < -50
    assert abs(rates[1, 1]) < 20
    assert falls[1, 1] == 0.0


def test_every_random_episode_ends_some_way() -> None:
    ended, warned = outcomes("fast", "flat", episodes=7, seconds=0.5)
    assert ended.total() == 7
    assert set(ended) <= {"timeout", "fall", "left_arena"}
    assert not warned
