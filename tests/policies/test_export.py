import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, SAC, TD3
from torch import nn

from flyrl.policies import LearnedPolicy, TermLayout
from flyrl.policies.export import bundle_from_sb3
from tests.policies.conftest import Bandit

LAYOUT = (TermLayout("all", 40),)


def _perturbed(model):
    # Fresh SB3 policies have tiny output weights: with larger ones, the bounds and tanh matter.
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))
    return model


@pytest.mark.parametrize("activation", [nn.Tanh, nn.ReLU])
@pytest.mark.parametrize("algorithm", [PPO, SAC])
@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.5, 1.5)])
def test_same_actions_as_sb3(algorithm, activation, low, high):
    kwargs = {"net_arch": [64, 64], "activation_fn": activation}
    model = _perturbed(
        algorithm(
            "MlpPolicy", Bandit(low=low, high=high), policy_kwargs=kwargs, device="cpu", seed=0
        )
    )
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    observations = np.random.default_rng(0).normal(size=(500, 40)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    actions, _ = policy.predict(observations)
    assert np.ptp(expected) > 1
    # ours are computed in float64; torch rounds to float32 in every layer
    np.testing.assert_allclose(actions, expected, rtol=0, atol=5e-6)


def test_later_training_does_not_change_the_bundle():
    model = PPO("MlpPolicy", Bandit(), device="cpu")
    policy = LearnedPolicy(bundle_from_sb3(model, LAYOUT, {}, {}))
    before, _ = policy.predict(np.ones(40))
    _perturbed(model)
    after, _ = LearnedPolicy(policy.bundle).predict(np.ones(40))
    np.testing.assert_array_equal(before, after)


def test_unknown_policies_are_refused():
    with pytest.raises(ValueError, match="policy: TD3Policy"):
        bundle_from_sb3(TD3("MlpPolicy", Bandit(), device="cpu"), LAYOUT, {}, {})


def test_unknown_layers_are_refused():
    kwargs = {"activation_fn": nn.ELU}
    model = PPO("MlpPolicy", Bandit(), policy_kwargs=kwargs, device="cpu")
    with pytest.raises(ValueError, match="layer: ELU; allowed: Linear, Tanh, ReLU"):
        bundle_from_sb3(model, LAYOUT, {}, {})
