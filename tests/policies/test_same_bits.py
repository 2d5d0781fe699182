"""A saved policy gives the same actions to the bit, wherever and however it is asked."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, load_policy, observation_layout, save_bundle
from flyrl.tasks import TASKS
from tests.policies.conftest import random_network

SIZE = sum(term.size for term in observation_layout(TASKS["target"]))


@pytest.fixture(params=["tanh", "clip"])
def steering(request, bundle):
    """As large as a trained policy for the task Target."""
    return replace(
        bundle,
        network=random_network((SIZE, 64, 64, 2), "tanh"),
        squashing=request.param,
        observation=observation_layout(TASKS["target"]),
    )


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


def test_in_single_and_batched_environments(loaded):
    together = _walk(gymnasium.make_vec("flyrl:flyrl/Target-v0", num_envs=3), loaded, seed=4)
    assert np.ptp(together) > 0.5
    for i in range(3):
        alone = _walk(gymnasium.make("flyrl:flyrl/Target-v0"), loaded, seed=4 + i)
        assert alone.tobytes() == np.ascontiguousarray(together[:, i]).tobytes()
