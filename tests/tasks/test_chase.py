"""Chase: a target on a circle, the same in what is observed, rewarded and drawn."""

import dataclasses

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.scene import build_scene
from flyrl.tasks import TASKS
from flyrl.tasks.chase import revolved
from flyrl.terrains import Flat
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
    env, twin = (BatchedEnv(EnvConfig(CHASE, terrain="blocks"), 2, 1) for _ in range(2))
    env.reset(seeds=[3, 4])
    starts = env.task_state().props.copy()
    for _ in range(5):
        env.step(np.full((2, 2), 0.5))
    twin.restore(env.snapshot())
    np.testing.assert_array_equal(twin.observe(), env.observe())
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


def test_targets_run_as_far_away_and_as_fast_as_asked_to_both_sides():
    rates = []
    for seed in range(100):
        episode = CHASE.sample_episode(Flat(), seed)
        start, (*centre, rate) = np.array(episode.props[:2]), episode.command
        assert 5 <= np.linalg.norm(start - episode.spawn_position_w[:2]) <= 10
        assert np.linalg.norm(start - centre) == pytest.approx(6)
        rates.append(rate)
    np.testing.assert_allclose(np.abs(rates), 8 / 6)
    assert 30 < sum(rate > 0 for rate in rates) < 70
