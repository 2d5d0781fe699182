"""Stable-Baselines3's own tools on the environments."""

import functools

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import LearnedPolicy, observation_layout
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.tasks import TASKS

SETTINGS = {"decision_interval": 0.1, "physics": "fast"}


@pytest.fixture(scope="module")
def single():
    """Monitored single environments, as SB3 makes them from an id."""
    make = functools.partial(gymnasium.make, "flyrl/Target-v0", **SETTINGS)
    env = make_vec_env(make, n_envs=2)
    yield env
    env.close()


@pytest.fixture(scope="module")
def batch():
    env = FlyrlVecEnv(EnvConfig(**SETTINGS), 2, num_threads=1)
    yield env
    env.close()


@pytest.fixture(scope="module")
def model(single):
    return PPO("MlpPolicy", single, device="cpu", seed=0)


@pytest.fixture(scope="module")
def policy(model):
    return LearnedPolicy(bundle_from_sb3(model, observation_layout(TASKS["target"]()), {}, {}))


def _evaluate(actor, env):
    env.seed(5)
    rewards, lengths = evaluate_policy(actor, env, n_eval_episodes=2, return_episode_rewards=True)
    assert max(lengths) <= 30
    return rewards


@pytest.mark.parametrize("actor", ["model", "policy"])
def test_evaluate_policy_finds_the_same_in_single_and_batched_environments(
    actor, single, batch, request
):
    actor = request.getfixturevalue(actor)
    returns = _evaluate(actor, single)
    assert np.ptp(returns) > 0.01
    np.testing.assert_allclose(_evaluate(actor, batch), returns, rtol=0, atol=1e-4)
