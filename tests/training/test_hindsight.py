"""Replay with other goals, on an episode made by hand."""

import numpy as np
import pytest
from gymnasium import spaces

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.training.models import HindsightBuffer

STEPS = 6


@pytest.fixture(scope="module")
def env():
    return FlyrlVecEnv(EnvConfig("target_goal"), 1, num_threads=1, seed=0)


LOST = 30.0


def _walked(env, strategy, is_failure=False):
    """A buffer with one episode: from 0 in steps of 2 mm to its goal at 12 mm, which ends it.

    With a failure, the goal is at 20 mm, and the last step is one that cuts LOST decisions off.
    """
    assert isinstance(env.observation_space, spaces.Dict)
    buffer = HindsightBuffer(
        20,
        env.observation_space,
        env.action_space,
        env,
        n_sampled_goal=10**6,
        goal_selection_strategy=strategy,
    )
    goal = 2.0 if is_failure else 0.2 * STEPS
    others = np.zeros((1, *env.observation_space["observation"].shape))

    def seen(step):
        goals = {"achieved_goal": [[0.2 * step, 0.0]], "desired_goal": [[goal, 0.0]]}
        return {**{name: np.array(goal) for name, goal in goals.items()}, "observation": others}

    for step in range(STEPS):
        is_end = np.array([step == STEPS - 1])
        has_failed = is_failure and bool(is_end)
        info = {"is_failure": has_failed, "decisions_lost": LOST * has_failed}
        reward = np.where(is_end, -1.0 - LOST if has_failed else 0.0, -1.0)
        action = np.full((1, 2), step / 10)
        buffer.add(seen(step), seen(step + 1), action, reward, is_end, [info])
    return buffer


def _fields(samples):
    """Goal, place come to, end, reward, and whether it was the last decision, of each sample."""
    is_last = samples.actions.numpy()[:, 0] == np.float32((STEPS - 1) / 10)
    goals = samples.observations["desired_goal"].numpy()[:, 0]
    places = samples.next_observations["achieved_goal"].numpy()[:, 0]
    return goals, places, samples.dones.numpy()[:, 0], samples.rewards.numpy()[:, 0], is_last


@pytest.mark.parametrize("is_failure", [False, True])
@pytest.mark.parametrize("strategy", ["future", "final", "episode"])
def test_reaching_the_new_goal_or_a_failure_is_an_end_and_nothing_else_is(
    strategy, is_failure, env
):
    np.random.seed(0)
    samples = _walked(env, strategy, is_failure).sample(400)
    goals, places, ends, rewards, is_last = _fields(samples)
    is_reached, has_failed = np.abs(goals - places) < 0.1, is_last & is_failure
    np.testing.assert_array_equal(ends, is_reached | has_failed)
    np.testing.assert_array_equal(rewards, is_reached - 1.0 - LOST * has_failed)
    np.testing.assert_array_equal(goals, samples.next_observations["desired_goal"].numpy()[:, 0])
    # every place that the fly came to, or the last alone, is a goal; also of the last decision.
    # Of the rest, the goal is the one that it had
    assert (is_last & is_reached).any()
    assert not is_reached[is_last].all() or strategy != "episode"
    found = np.unique(np.round(goals[goals < 2.0] / 0.2))
    np.testing.assert_array_equal(found, [STEPS] if strategy == "final" else np.arange(STEPS) + 1)


def test_a_failure_is_charged_with_its_own_goal_too(env):
    np.random.seed(0)
    buffer = _walked(env, "future", is_failure=True)
    buffer.her_ratio = 0.0
    goals, _, ends, rewards, is_last = _fields(buffer.sample(400))
    assert (goals == 2.0).all()
    assert is_last.any()
    np.testing.assert_array_equal(ends, is_last)
    np.testing.assert_array_equal(rewards, -1.0 - LOST * is_last)


def test_a_decision_that_takes_the_place_of_a_failure_is_none(env):
    buffer = _walked(env, "future", is_failure=True)
    buffer.pos = 0
    seen = {name: values[0] for name, values in buffer.observations.items()}
    info = {"is_failure": False, "decisions_lost": 0.0}
    for _ in range(STEPS):
        buffer.add(seen, seen, np.zeros((1, 2)), np.zeros(1), np.array([False]), [info])
    assert not any(values.any() for values in buffer.failures.values())
