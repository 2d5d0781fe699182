"""Slalom: gates in turn, on states made by hand and in an environment."""

import dataclasses

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.tasks import TASKS
from flyrl.terrains import Flat
from tests.tasks.test_terms import fly_state, task_state

SLALOM = TASKS["slalom"](gates=3)
OBSERVED = {term.name: term for term in SLALOM.observation}
REWARDS = {term.name: term for term in SLALOM.reward}
GATES = [[5.0, 0.0, 0.0], [5.0, 5.0, 0.0], [0.0, 5.0, 0.0]]


def _state(passed, fly=None, previous=None):
    state = task_state(fly or fly_state(), previous, gates=[passed])
    return dataclasses.replace(state, props=np.array([GATES]))


@pytest.mark.parametrize(
    ("passed", "direction", "distance", "after"),
    [
        (0, (1, 0), 5, np.array([1, 1]) / np.sqrt(2)),
        (1, np.array([1, 1]) / np.sqrt(2), np.hypot(5, 5), (0, 1)),
        (2, (0, 1), 5, (0, 1)),  # after the last gate there is none
    ],
)
def test_the_gate_that_is_due_follows_from_those_passed(passed, direction, distance, after):
    state = _state(passed)
    np.testing.assert_allclose(OBSERVED["target_direction"].compute(state), [direction], atol=1e-12)
    np.testing.assert_allclose(OBSERVED["target_distance"].compute(state), [[distance / 15]])
    np.testing.assert_allclose(OBSERVED["next_direction"].compute(state), [after], atol=1e-12)


def test_progress_gates_and_success_are_those_of_the_gates_that_are_due():
    state = _state(2, fly_state(position_w=[[0, 2, 1]]), fly_state())
    np.testing.assert_allclose(REWARDS["progress"].compute(state), [2.0])
    at_second = fly_state(position_w=[[5, 5, 1]])
    passed = [bool(REWARDS["gates"].compute(_state(n, at_second))[0]) for n in range(3)]
    assert passed == [False, True, False]
    success = SLALOM.terminations[0]
    assert success.is_success
    assert [success.holds(_state(n)).tolist() for n in range(4)] == [[False]] * 3 + [[True]]


def test_an_episode_counts_gates_and_ends_with_the_last():
    env = BatchedEnv(EnvConfig(TASKS["slalom"](gates=2)), 1, 1)
    episode = env.config.sample_episode(0)
    x, y, _ = episode.spawn_position_w
    # the fly starts at the first gate and walks on through the second
    episode = dataclasses.replace(episode, props=(x, y, 0.0, x + 4.0, y, 0.0))
    env.reset(episodes=[episode])
    passed, outcome = [], "running"
    while outcome == "running":
        outcome = str(env.step(np.full((1, 2), 0.5)).outcome[0])
        passed.append(float(env.task_state().totals["gates"][0]))
    assert outcome == "success"
    assert passed == [1.0] * (len(passed) - 1) + [2.0]
    assert len(passed) > 1


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_gates_lie_as_far_and_as_aside_as_asked(difficulty):
    for seed in range(50):
        episode = TASKS["slalom"]().sample_episode(Flat(), seed, difficulty)
        gates = np.reshape(episode.props, (5, 3))[:, :2]
        steps = np.diff([episode.spawn_position_w[:2], *gates], axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        assert 3 - 1e-9 <= lengths.min() <= lengths.max() <= 3 + 5 * difficulty + 1e-9
        directions = np.arctan2(steps[:, 1], steps[:, 0])
        turns = (np.diff([0.0, *directions]) + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(turns).max() <= difficulty * np.pi / 2 + 1e-9


def test_gates_lie_on_the_ground():
    env = BatchedEnv(EnvConfig("slalom", terrain="blocks"), 1, 1)
    env.reset(seeds=[0])
    terrain, ground = env.config.scene.terrain, env.batch.ground(0)
    for x, y, z in env.task_state().props[0]:
        top = terrain.top_at(ground, x, y)
        assert z == pytest.approx((terrain.base_height if top is None else top) + 0.02)


def test_a_single_gate_has_a_marker():
    assert len(TASKS["slalom"](gates=1).sample_episode(Flat(), 0).props) == 3
