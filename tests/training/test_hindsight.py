"""Replay with other goals, on an episode made by hand."""

import numpy as np
import pytest
from gymnasium import spaces

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyVecEnv
from flyrl.training.hindsight import HindsightBuffer

STEPS = 6


@pytest.fixture(scope="module")
def env():
    return FlyVecEnv(EnvConfig("target_goal"), 1, num_threads=1, seed=0)


def _walked(env, strategy):
    """A buffer with one episode: from 0 in steps of 2 mm to its goal at 12 mm, which ends it."""
    assert isinstance(env.observation_space, spaces.Dict)
    buffer = HindsightBuffer(
        20,
        env.observation_space,
        env.action_space,
        env,
        n_sampled_goal=10**6,
        goal_selection_strategy=strategy,
    )
    others = np.zeros((1, *env.observation_space["observation"].shape))

    def seen(step):
        goals = {"achieved_goal": [[0.2 * step, 0.0]], "desired_goal": [[0.2 * STEPS, 0.0]]}
        return {**{name: np.array(goal) for name, goal in goals.items()}, "observation": others}

    for step in range(STEPS):
        is_end = np.array([step == STEPS - 1])
        action, reward = np.full((1, 2), step / 10), np.where(is_end, 0.0, -1.0)
        buffer.add(seen(step), seen(step + 1), action, reward, is_end, [{}])
    return buffer


@pytest.mark.parametrize("strategy", ["future", "final", "episode"])
def test_reaching_the_new_goal_is_an_end_and_nothing_else_is(strategy, env):
    np.random.seed(0)
    samples = _walked(env, strategy).sample(400)
    goals = samples.observations["desired_goal"].numpy()
    places = samples.next_observations["achieved_goal"].numpy()
    is_reached = (np.abs(goals - places)[:, 0] < 0.1).astype(np.float32)
    np.testing.assert_array_equal(samples.dones.numpy()[:, 0], is_reached)
    np.testing.assert_array_equal(samples.rewards.numpy()[:, 0], is_reached - 1)
    np.testing.assert_array_equal(goals, samples.next_observations["desired_goal"].numpy())
    # every place that the fly came to, or the last alone, is a goal
    found = np.unique(np.round(goals[:, 0] / 0.2))
    np.testing.assert_array_equal(found, [STEPS] if strategy == "final" else np.arange(STEPS) + 1)


def test_the_last_step_is_no_end_for_a_goal_passed_before(env):
    np.random.seed(0)
    samples = _walked(env, "episode").sample(400)
    is_last = samples.actions.numpy()[:, 0] == np.float32((STEPS - 1) / 10)
    is_other = samples.observations["desired_goal"].numpy()[:, 0] < 1.1
    assert (is_last & is_other).sum() > 20
    assert not samples.dones.numpy()[is_last & is_other].any()
