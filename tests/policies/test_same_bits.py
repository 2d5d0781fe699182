"""A saved policy gives the same actions to the bit, wherever and however it is asked."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, load_policy, observation_layout, save_bundle
from flyrl.tasks import TASKS
from tests.policies.conftest import random_network

SIZE = sum(term.size for term in observation_layout(TASKS["target"]()))


@pytest.fixture(params=["tanh", "clip"])
def steering(request, bundle):
    """As large as a trained policy for the task Target."""
    return replace(
        bundle,
        network=random_network((SIZE, 64, 64, 2), "tanh"),
        squashing=request.param,
        observation=observation_layout(TASKS["target"]()),
    )


@pytest.fixture
def goal_policy(bundle, tmp_path):
    """The same for the task with goals, saved and loaded."""
    layout = observation_layout(TASKS["target_goal"]())
    network = random_network((sum(term.size for term in layout), 64, 64, 2), "tanh")
    save_bundle(replace(bundle, network=network, observation=layout), tmp_path / "p.safetensors")
    return load_policy(tmp_path / "p.safetensors")


@pytest.fixture
def loaded(steering, tmp_path):
    save_bundle(steering, tmp_path / "policy.safetensors")
    return load_policy(tmp_path / "policy.safetensors")


def test_on_reload(steering, loaded):
    observations = np.random.default_rng(0).normal(size=(300, SIZE)).astype(np.float32)
    before, _ = LearnedPolicy(steering).predict(observations)
    after, _ = loaded.predict(observations)
    assert np.ptp(before) > 1
    assert after.tobytes() == before.tobytes()


def _walk(env, policy, seed):
    observation, _ = env.reset(seed=seed)
    actions = []
    for _ in range(20):
        action, _ = policy.predict(observation)
        actions.append(action)
        observation, *_ = env.step(action)
    env.close()
    return np.array(actions)


def _check_single_and_batched(env_id, policy):
    together = _walk(gymnasium.make_vec(env_id, num_envs=3), policy, seed=4)
    assert np.ptp(together) > 0.5
    for i in range(3):
        alone = _walk(gymnasium.make(env_id), policy, seed=4 + i)
        assert alone.tobytes() == np.ascontiguousarray(together[:, i]).tobytes()


def test_in_single_and_batched_environments(loaded):
    _check_single_and_batched("flyrl:flyrl/Target-v0", loaded)


def test_in_single_and_batched_environments_with_goals(goal_policy):
    _check_single_and_batched("flyrl:flyrl/TargetGoal-v0", goal_policy)
