import re

import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary, MultiDiscrete
from sb3_contrib import ARS, TQC, TRPO, CrossQ, RecurrentPPO
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.policies import LearnedPolicy, TermLayout
from flyrl.policies.sb3 import bundle_from_sb3
from tests.policies.conftest import Bandit, ChoiceBandit, DictBandit, perturbed

LAYOUT = (TermLayout("all", 40),)


def _model(algorithm, env, policy="MlpPolicy", **kwargs):
    return perturbed(algorithm(policy, env, policy_kwargs=kwargs, device="cpu", seed=0))


def _observations(*shape):
    return np.random.default_rng(0).normal(size=shape).astype(np.float32)


@pytest.mark.parametrize("activation", [nn.Tanh, nn.ReLU])
@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO, SAC, TQC, CrossQ, TD3, DDPG])
@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.5, 1.5)])
def test_same_actions_as_sb3(algorithm, activation, low, high):
    env = Bandit(low=low, high=high)
    model = _model(algorithm, env, net_arch=[64, 64], activation_fn=activation)
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    observations = _observations(500, 40)
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = policy.predict(observations)
    assert np.ptp(expected) > 1
    # ours are computed in float64; torch rounds to float32 in every layer
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO])
def test_same_whole_numbers_as_sb3(algorithm):
    model = _model(algorithm, ChoiceBandit(), net_arch=[64, 64])
    bundle = bundle_from_sb3(model, LAYOUT, {}, {})
    assert (bundle.action_low, bundle.action_high) == ((0, 0), (15, 7))
    observations = _observations(500, 40)
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = LearnedPolicy(bundle).predict(observations)
    assert [len(np.unique(column)) for column in expected.T] == [16, 8]
    assert actions.dtype == expected.dtype
    np.testing.assert_array_equal(actions, expected)


def test_same_whole_numbers_as_a_recurrent_model():
    model = _model(
        RecurrentPPO, ChoiceBandit(), "MlpLstmPolicy", net_arch=[16], lstm_hidden_size=24
    )
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    rng = np.random.default_rng(1)
    state = expected_state = None
    for observations in 3 * _observations(30, 5, 40):
        starts = rng.random(5) < 0.2
        expected, expected_state = model.predict(observations, expected_state, starts, True)
        actions, state = policy.predict(observations, state, starts)
        np.testing.assert_array_equal(actions, expected)
        np.testing.assert_allclose(state, expected_state, rtol=0, atol=5e-6)


@pytest.mark.parametrize(
    "space", [Discrete(4), MultiBinary(4), MultiDiscrete([4, 2], start=np.array([0, 1]))]
)
def test_other_spaces_of_actions_are_refused(space):
    env = Bandit()
    env.action_space = space
    model = PPO("MlpPolicy", env, device="cpu")
    message = f"to a Box of actions or a MultiDiscrete from 0; got {re.escape(str(space))}"
    with pytest.raises(ValueError, match=message):
        bundle_from_sb3(model, LAYOUT, {}, {})


def _parts(n):
    return {
        "observation": _observations(n, 5),
        "desired_goal": _observations(n + 1, 2)[1:],
        "achieved_goal": _observations(n + 2, 2)[2:],
    }


DICT_LAYOUT = (
    TermLayout("achieved_goal", 2),
    TermLayout("desired_goal", 2),
    TermLayout("speed", 2),
    TermLayout("other", 3),
)


@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO, SAC, TQC, TD3, DDPG, RecurrentPPO])
def test_same_actions_as_sb3_for_dicts(algorithm):
    name = "MultiInputLstmPolicy" if algorithm is RecurrentPPO else "MultiInputPolicy"
    model = _model(algorithm, DictBandit(), name, net_arch=[64, 64])
    policy = LearnedPolicy(bundle_from_sb3(model, DICT_LAYOUT, {}, {}))
    observations = _parts(300)
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = policy.predict(observations)
    assert np.ptp(expected) > 0.1
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


def test_normaliser_of_dicts_comes_along():
    env = VecNormalize(DummyVecEnv([DictBandit]), clip_obs=1.5)
    model = _model(PPO, env, "MultiInputPolicy", net_arch=[16])
    rng = np.random.default_rng(2)
    for moments in env.obs_rms.values():
        size = len(moments.mean)
        moments.mean, moments.var = rng.normal(size=size), rng.uniform(0.1, 2, size=size)
    observations = _parts(200)
    expected, _ = model.predict(env.normalize_obs(observations), deterministic=True)
    actions, _ = LearnedPolicy(bundle_from_sb3(model, DICT_LAYOUT, {}, {})).predict(observations)
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


@pytest.mark.parametrize("num_layers", [1, 2])
def test_same_actions_and_memory_as_a_recurrent_model(num_layers):
    model = _model(
        RecurrentPPO,
        Bandit(),
        "MlpLstmPolicy",
        net_arch=[16],
        lstm_hidden_size=24,
        n_lstm_layers=num_layers,
    )
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    rng = np.random.default_rng(1)
    state = expected_state = None
    for observations in 3 * _observations(30, 5, 40):
        starts = rng.random(5) < 0.2
        expected, expected_state = model.predict(observations, expected_state, starts, True)
        actions, state = policy.predict(observations, state, starts)
        np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)
        np.testing.assert_allclose(state, expected_state, rtol=0, atol=5e-6)
    assert np.abs(state).max() > 0.5


def test_normaliser_comes_along():
    env = VecNormalize(DummyVecEnv([Bandit]), clip_obs=1.5)
    model = _model(PPO, env, net_arch=[16])
    rng = np.random.default_rng(2)
    env.obs_rms.mean, env.obs_rms.var = rng.normal(size=40), rng.uniform(0.1, 2, size=40)
    observations = _observations(200, 40)
    expected, _ = model.predict(env.normalize_obs(observations), deterministic=True)
    bundle = bundle_from_sb3(model, LAYOUT, {}, {})
    actions, _ = LearnedPolicy(bundle).predict(observations)
    assert (bundle.normaliser.epsilon, bundle.normaliser.clip) == (env.epsilon, 1.5)
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


def test_rewards_alone_need_no_normaliser():
    env = VecNormalize(DummyVecEnv([Bandit]), norm_obs=False)
    assert bundle_from_sb3(_model(PPO, env), LAYOUT, {}, {}).normaliser is None


def test_later_training_does_not_change_the_bundle():
    env = VecNormalize(DummyVecEnv([Bandit]))
    model = PPO("MlpPolicy", env, device="cpu")
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    before, _ = policy.predict(np.ones(40))
    perturbed(model)
    env.obs_rms.mean += 1
    after, _ = LearnedPolicy(policy.bundle).predict(np.ones(40))
    np.testing.assert_array_equal(before, after)


def test_unknown_policies_are_refused():
    with pytest.raises(ValueError, match="policy: ARSPolicy"):
        bundle_from_sb3(ARS("MlpPolicy", Bandit(), device="cpu"), LAYOUT, {}, {})


def test_unknown_layers_are_refused():
    kwargs = {"activation_fn": nn.ELU}
    model = PPO("MlpPolicy", Bandit(), policy_kwargs=kwargs, device="cpu")
    with pytest.raises(ValueError, match="layer: ELU; allowed: Linear, Tanh, ReLU"):
        bundle_from_sb3(model, LAYOUT, {}, {})


def test_unknown_lstms_are_refused():
    kwargs = {"lstm_kwargs": {"bias": False}}
    model = RecurrentPPO("MlpLstmPolicy", Bandit(), policy_kwargs=kwargs, device="cpu")
    with pytest.raises(ValueError, match="LSTMs with biases"):
        bundle_from_sb3(model, LAYOUT, {}, {})
