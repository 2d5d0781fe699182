"""Networks against torch, and themselves in other batches; by hand: see test_learned."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.policies import LearnedPolicy, TermLayout
from flyrl.policies.networks import LSTM_PARTS, Normaliser, lstm_step
from tests.policies.conftest import Bandit, random_network, walked


def test_an_lstm_is_that_of_torch():
    weights = random_network((5, 1), lstm_sizes=(7, 5, 5, 5))["weights"]
    module = nn.LSTM(7, 5, num_layers=3).double()
    names = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    for i, (part, name) in product(range(3), zip(LSTM_PARTS, names, strict=True)):
        getattr(module, f"{name}_l{i}").data = torch.from_numpy(
            weights[f"lstm.{i}.{part}"]
        ).double()
    inputs = np.random.default_rng(1).normal(size=(20, 4, 7))
    hidden, cell = np.zeros((3, 4, 5)), np.zeros((3, 4, 5))
    outputs, (last_hidden, last_cell) = module(torch.from_numpy(inputs))
    for step in range(20):
        hidden, cell = lstm_step(weights, inputs[step], hidden, cell)
        np.testing.assert_allclose(hidden[-1], outputs[step].detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(hidden, last_hidden.detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(cell, last_cell.detach(), rtol=0, atol=1e-12)


CHOICES = {"squashing": "argmax", "action_low": (0.0, -1.0), "action_high": (2.0, 0.0)}


@pytest.mark.parametrize("n", [None, 1, 2, 7, 32])
@pytest.mark.parametrize(
    "changes",
    [
        random_network((37, 64, 64, 2)),
        random_network((37, 64, 64, 2), "relu"),
        random_network((37, 64, 64, 5)) | CHOICES,
        random_network((30, 64, 2), lstm_sizes=(37, 30, 30)),
    ],
    ids=["tanh", "relu", "argmax", "lstm"],
)
def test_a_row_does_not_depend_on_the_rows_beside_it(n, changes, bundle):
    policy = LearnedPolicy(replace(bundle, **changes, observation=(TermLayout("all", 37),)))
    steps = np.random.default_rng(0).normal(scale=0.3, size=(4, 33, 37)).astype(np.float32)
    actions, _ = walked(policy, steps)
    assert (actions.min(axis=(0, 1)) < actions.max(axis=(0, 1))).all()
    for start in range(0, 33, n or 1):
        rows = start if n is None else slice(start, start + n)
        alone, _ = walked(policy, steps[:, rows])
        np.testing.assert_array_equal(alone, actions[:, rows])


def test_normalised_to_the_same_bits_as_in_training():
    env = VecNormalize(DummyVecEnv([lambda: Bandit(7)] * 5))
    env.seed(0)
    env.reset()
    for _ in range(10):
        env.step(np.zeros((5, 2), np.float32))
    normaliser = Normaliser(env.obs_rms.mean, env.obs_rms.var, env.epsilon, env.clip_obs)
    observations = np.random.default_rng(0).normal(0, 20, size=(50, 7)).astype(np.float32)
    normalised = normaliser.apply(observations.astype(np.float64))
    np.testing.assert_array_equal(normalised, env.normalize_obs(observations))
