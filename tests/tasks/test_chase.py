"""Chase: a target on a circle, the same in what is observed, rewarded and drawn."""

import dataclasses

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.scene import build_scene
from flyrl.tasks import TASKS
from flyrl.tasks.chase import revolved
from flyrl.terrains import LITERATURE, TERRAINS
from tests.tasks.test_terms import fly_state, task_state

CHASE = TASKS["chase"]()
OBSERVED = {term.name: term for term in CHASE.observation}
REWARDS = {term.name: term for term in CHASE.reward}

# a quarter of a circle about (4, 0) in 1 s, from (4, -2), counter-clockwise
START = np.array([[4.0, -2.0, 0.02]])
COMMAND = np.array([[4.0, 0.0, np.pi / 2]])


def _state(time_s=1.0, fly=None, previous=None):
    fly = fly or fly_state(time=[time_s])
    state = task_state(fly, previous, command=COMMAND)
    return dataclasses.replace(state, props=revolved(START, fly.time, COMMAND)[:, None])


def test_the_target_runs_along_its_circle():
    np.testing.assert_allclose(revolved(START, np.zeros(1), COMMAND), START, atol=1e-12)
    np.testing.assert_allclose(revolved(START, np.ones(1), COMMAND), [[6, 0, 0.02]], atol=1e-12)


def test_direction_distance_and_velocity_are_those_of_the_place_now():
    state = _state()
    np.testing.assert_allclose(OBSERVED["target_direction"].compute(state), [[1, 0]], atol=1e-12)
    np.testing.assert_allclose(OBSERVED["target_distance"].compute(state), [[6 / 15]])
    velocity = [[0, 2 * np.pi / 2 / 20]]  # to the left
    np.testing.assert_allclose(OBSERVED["target_velocity"].compute(state), velocity, atol=1e-12)


def test_a_target_that_flees_costs_what_it_gains():
    # the fly stands at (4, -3): 1 mm from the target at first, then 3 mm away from (6, 0)
    here = [[4.0, -3.0, 1.0]]
    state = _state(fly=fly_state(time=[1.0], position_w=here), previous=fly_state(position_w=here))
    np.testing.assert_allclose(REWARDS["progress"].compute(state), [1 - np.sqrt(13)])


def test_to_be_near_is_to_catch_it():
    for x, caught in ((5.1, True), (4.9, False)):
        state = _state(fly=fly_state(time=[1.0], position_w=[[x, 0, 1]]))
        assert CHASE.terminations[0].holds(state).tolist() == [caught]
        assert REWARDS["success"].compute(state).tolist() == [caught]


def test_observation_reward_and_picture_have_the_target_at_the_same_place():
    env = BatchedEnv(EnvConfig(CHASE, terrain="blocks"), 2, 1)
    env.reset(seeds=[3, 4])
    starts = env.task_state().props.copy()
    for _ in range(5):
        env.step(np.full((2, 2), 0.5))
    state = env.task_state()
    commands = np.array([episode.command for episode in env.episodes])
    expected = revolved(starts[:, 0], np.full(2, 0.1), commands)
    np.testing.assert_allclose(state.props[:, 0], expected)
    moved = np.linalg.norm(state.props - starts, axis=2)[:, 0]
    np.testing.assert_allclose(moved, 2 * 6 * np.sin(0.8 / 6 / 2))  # chord of 0.8 mm
    drawn = build_scene(env.config.scene, visual=True).model
    data = mujoco.MjData(drawn)
    env.batch.copy_into(1, drawn, data)
    np.testing.assert_array_equal(data.mocap_pos[0], state.props[1, 0])


def test_a_restored_environment_goes_on_with_its_target():
    first, second = (BatchedEnv(EnvConfig(CHASE), 2, 1) for _ in range(2))
    first.reset(seeds=[1, 2])
    first.step(np.zeros((2, 2)))
    second.restore(first.snapshot())
    np.testing.assert_array_equal(
        first.step(np.ones((2, 2))).observation, second.step(np.ones((2, 2))).observation
    )


@pytest.mark.parametrize("terrain", LITERATURE)
def test_the_way_of_the_target_lies_on_the_terrain_as_far_as_asked(terrain):
    bounds = TERRAINS[terrain].bounds
    for seed in range(50):
        episode = CHASE.sample_episode(TERRAINS[terrain], seed)
        start, command = np.array([episode.props]), np.array([episode.command])
        assert 5 <= np.linalg.norm(start[0, :2] - episode.spawn_position_w[:2]) <= 10
        assert np.linalg.norm(start[0, :2] - command[0, :2]) == pytest.approx(6)
        assert abs(command[0, 2]) == pytest.approx(8 / 6)
        for time_s in (0.0, 1.3, 4.0):
            x, y, _ = revolved(start, np.array([time_s]), command)[0]
            assert bounds.x_min < x < bounds.x_max
            assert bounds.y_min < y < bounds.y_max


def test_targets_turn_to_both_sides():
    rates = [CHASE.sample_episode(TERRAINS["flat"], seed).command[2] for seed in range(100)]
    assert 30 < sum(rate > 0 for rate in rates) < 70


def test_a_terrain_without_room_is_refused():
    with pytest.raises(ValueError, match=r"task\.radius must leave the target room on .*'blocks'"):
        TASKS["chase"](radius=60, speed=60).sample_episode(TERRAINS["blocks"], 0)
