import numpy as np
import pytest

from flyrl.tasks import TASKS
from flyrl.tasks.episode import draw_oscillators
from flyrl.tasks.target import TARGET
from flyrl.terrains import TERRAIN_NAMES, TerrainConfig, terrain_bounds


@pytest.mark.parametrize("terrain", TERRAIN_NAMES)
def test_targets_lie_5_to_15_mm_away_on_the_terrain(terrain: str) -> None:
    config = TerrainConfig(name=terrain)
    bounds = terrain_bounds(config)
    for seed in range(300):
        episode = TARGET.sample_episode(config, seed)
        x, y, _ = episode.spawn_position_w
        distance = np.hypot(episode.goal[0] - x, episode.goal[1] - y)
        assert 5 <= distance <= 15
        assert -2 <= x <= 2
        assert -2 <= y <= 2
        assert bounds.x_min < episode.goal[0] < bounds.x_max
        assert bounds.y_min < episode.goal[1] < bounds.y_max


def test_targets_lie_in_every_direction() -> None:
    config = TerrainConfig()
    bearings = [
        np.arctan2(
            episode.goal[1] - episode.spawn_position_w[1],
            episode.goal[0] - episode.spawn_position_w[0],
        )
        for episode in (TARGET.sample_episode(config, seed) for seed in range(400))
    ]
    counts, _ = np.histogram(bearings, bins=8, range=(-np.pi, np.pi))
    assert counts.min() > 25


@pytest.mark.parametrize("name", TASKS)
def test_an_episode_is_a_function_of_its_seed(name: str) -> None:
    task, config = TASKS[name], TerrainConfig()
    assert task.sample_episode(config, 5) == task.sample_episode(config, 5)
    assert task.sample_episode(config, 5) != task.sample_episode(config, 6)


def test_oscillators_are_drawn_phases_first() -> None:
    phases, magnitudes = draw_oscillators(7)
    random_state = np.random.RandomState(7)
    np.testing.assert_array_equal(phases, random_state.uniform(0, 2 * np.pi, 6))
    np.testing.assert_array_equal(magnitudes, random_state.uniform(0, 1, 6))


def test_the_normalised_action_spans_the_drive_range() -> None:
    drive = TARGET.drive(np.array([[-1.0, 1.0], [0.0, 5.0]]))
    np.testing.assert_allclose(drive, [[-0.5, 1.5], [0.5, 1.5]])
    np.testing.assert_allclose(TARGET.action(drive), [[-1, 1], [0, 1]])


def test_the_bare_action_is_the_drive() -> None:
    drive = np.array([[1.2, 0.2], [-0.5, 1.5]])
    np.testing.assert_allclose(TASKS["hybrid_turning"].drive(drive), drive)


def test_slices_cover_the_observation_once() -> None:
    covered = np.concatenate([np.arange(46)[part] for part in TARGET.slices().values()])
    np.testing.assert_array_equal(covered, np.arange(46))
    assert TARGET.slices()["target_distance"] == slice(2, 3)
