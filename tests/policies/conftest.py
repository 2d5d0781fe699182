"""A small bundle, and small SB3 models, to save, break and compare."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from sb3_contrib.common.torch_layers import BatchRenorm

from flyrl.policies.bundle import PolicyBundle, TermLayout, weight_shapes
from flyrl.policies.networks import Normaliser

LAYOUT = (TermLayout("bearing", 2), TermLayout("speed", 1))


def random_network(sizes, activation="tanh", lstm_sizes=()):
    """Fields of a bundle with random weights.

    Its outputs spread beyond -1 and 1, so that bounds and tanh matter.
    """
    rng, weights = np.random.default_rng(1), {}
    for name, shape in weight_shapes(sizes, lstm_sizes).items():
        scale = 0.1 if len(shape) == 1 else 2 * shape[1] ** -0.5
        scale = 1.0 if name.startswith("lstm") else scale
        weights[name] = rng.normal(scale=scale, size=shape).astype(np.float32)
    return {
        "weights": weights,
        "sizes": sizes,
        "activation": activation,
        "lstm_sizes": lstm_sizes,
    }


def observed(task, count=1, **terms):
    """Observations (n, k) with these values of some terms; all others are 9."""
    observations = np.full((count, sum(term.size for term in task.observation)), 9.0)
    for name, values in terms.items():
        observations[:, task.slices()[name]] = values
    return observations


def walked(policy, observations, starts=None):
    """Actions (T, ...) on one observation after the other, and the last state."""
    state, actions = None, []
    for i, observation in enumerate(observations):
        start = None if starts is None else starts[i]
        action, state = policy.predict(observation, state, start)
        actions.append(action)
    return np.array(actions), state


@pytest.fixture
def bundle() -> PolicyBundle:
    """Three inputs, two hidden units, two outputs, with weights that are easy to follow by hand."""
    weights = {
        "0.weight": [[1, 0, 0], [0, 2, 0]],
        "0.bias": [0, 1],
        "1.weight": [[1, 0], [1, -1]],
        "1.bias": [0.5, 0],
    }
    return PolicyBundle(
        weights={name: np.array(values, np.float32) for name, values in weights.items()},
        sizes=(3, 2, 2),
        activation="relu",
        squashing="clip",
        observation=LAYOUT,
        action_low=(-1.0, -1.0),
        action_high=(1.0, 1.0),
        env={"task": "target"},
        training={"decisions": 7},
    )


@pytest.fixture
def choosing(bundle) -> PolicyBundle:
    """The same as `bundle`, but for its last layer: it chooses one of 3 and one of 2 numbers."""
    rows = [[0, 0], [1, 0], [0, 1], [2, 0], [0, 1]]
    last = {
        "1.weight": np.array(rows, np.float32),
        "1.bias": np.array([0.5, 0, 0, 0, 0], np.float32),
    }
    return replace(
        bundle,
        weights={**bundle.weights, **last},
        sizes=(3, 2, 5),
        squashing="argmax",
        action_low=(0.0, -1.0),
        action_high=(2.0, 0.0),
    )


@pytest.fixture
def recurrent(bundle) -> PolicyBundle:
    """One that normalises its observations and remembers, with random weights."""
    return replace(
        bundle,
        **random_network((3, 2, 2), "relu", (3, 3, 3)),
        normaliser=Normaliser(np.array([0.1, 0, -1]), np.array([1, 0.3, 2]), 1e-8, 10.0),
    )


def perturbed(model):
    """A model with larger weights: a fresh one's are too tiny for bounds and tanh to matter."""
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))
        for module in model.policy.modules():
            if isinstance(module, BatchRenorm):
                module.ra_mean.add_(torch.randn(module.ra_mean.shape, generator=generator))
                module.ra_var.mul_(0.1 + torch.rand(module.ra_var.shape, generator=generator))
    return model


class Bandit(gymnasium.Env):
    """One-step problem, only there to build models.

    Its observation has one part, or several of these sizes by name.
    """

    def __init__(self, size=40, action_space=None):
        parts = {
            name: spaces.Box(-10, 10, (n,), np.float32)
            for name, n in (size if isinstance(size, dict) else {"all": size}).items()
        }
        self.observation_space = spaces.Dict(parts) if isinstance(size, dict) else parts["all"]
        self.action_space = action_space or spaces.Box(-0.5, 1.5, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        return self.observation_space.sample(), 0.0, True, False, {}
