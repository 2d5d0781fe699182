"""Stable-Baselines3's own tools on the environments."""

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import LearnedPolicy, observation_layout
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.tasks import TASKS
from tests.clients.usual import LIMIT, SETTINGS, make


def test_evaluate_policy_finds_the_same_in_single_and_batched_environments():
    """The single ones are monitored, as SB3 makes them from an id."""
    single, batch = make_vec_env(make, n_envs=2), FlyrlVecEnv(EnvConfig(**SETTINGS), 2, 1)
    model = PPO("MlpPolicy", single, device="cpu", seed=0)
    bundle = bundle_from_sb3(model, observation_layout(TASKS["target"]()), {}, {})

    def returns(actor, env):
        env.seed(5)
        found, lengths = evaluate_policy(actor, env, n_eval_episodes=2, return_episode_rewards=True)
        assert max(lengths) <= LIMIT
        return found

    for actor in (model, LearnedPolicy(bundle)):
        expected = returns(actor, single)
        assert np.ptp(expected) > 0.01
        np.testing.assert_allclose(returns(actor, batch), expected, rtol=0, atol=1e-4)
    single.close()
    batch.close()
