"""The grid of drives, and how two grids are compared."""

import numpy as np
import pytest

from benchmarks.fidelity.stability import outcomes
from benchmarks.fidelity.turning import relative_difference, slope, yaw_rates

GRID = np.array([[0.0, 100.0], [-100.0, 0.0]])


def test_the_difference_is_relative_to_the_whole_grid() -> None:
    assert relative_difference(GRID * 1.1, GRID) == pytest.approx(0.1)
    assert relative_difference(GRID, GRID) == 0.0
    assert relative_difference(-GRID, GRID) == pytest.approx(2.0)


def test_slope_is_the_common_factor() -> None:
    assert slope(1.2 * GRID, GRID) == pytest.approx(1.2)


@pytest.mark.slow
def test_flies_turn_towards_the_weaker_side_and_zero_drive_does_not_turn() -> None:
    """Left drive -0.5, 0.5, 1.5 by right drive."""
    rates, falls = yaw_rates("fast", 3, conditions=2, seconds=0.5)
    assert rates[1, 2] > 50
    assert rates[2, 1] < -50
    assert abs(rates[1, 1]) < 20
    assert falls[1, 1] == 0.0


@pytest.mark.slow
def test_every_random_episode_ends_some_way() -> None:
    ended, warned = outcomes("fast", "flat", episodes=7, seconds=0.5)
    assert ended.total() == 7
    assert set(ended) <= {"timeout", "fall", "left_arena"}
    assert not warned
