"""A small bundle, and small SB3 models, to save, break and compare."""

from dataclasses import replace
from itertools import pairwise

import gymnasium
import numpy as np
import pytest
import torch
from sb3_contrib.common.torch_layers import BatchRenorm

from flyrl.policies.bundle import PolicyBundle, TermLayout
from flyrl.policies.networks import LSTM, MLP, Activation, Layer, LSTMLayer, Normaliser

LAYOUT = (TermLayout("bearing", 2), TermLayout("speed", 1))


def random_network(sizes: tuple[int, ...], activation: Activation) -> MLP:
    """A network whose outputs spread beyond -1 and 1, so that bounds and tanh matter."""
    rng = np.random.default_rng(1)
    return MLP(
        tuple(
            Layer(
                rng.normal(scale=2 * i**-0.5, size=(o, i)).astype(np.float32),
                rng.normal(scale=0.1, size=o).astype(np.float32),
            )
            for i, o in pairwise(sizes)
        ),
        activation,
    )


def random_lstm(sizes: tuple[int, ...], scale: float = 0.5) -> LSTM:
    """An LSTM with random weights; sizes as in `LSTM.sizes`."""
    rng = np.random.default_rng(0)
    layers = []
    for inputs, units in pairwise(sizes):
        shapes = ((4 * units, inputs), (4 * units, units), (4 * units,), (4 * units,))
        layers.append(LSTMLayer(*(rng.normal(0, scale, s).astype(np.float32) for s in shapes)))
    return LSTM(tuple(layers))


def same_weights(one: PolicyBundle, other: PolicyBundle) -> bool:
    """Whether networks and memories have the same weights to the bit."""

    def weights(bundle):
        layers = [*bundle.network.layers, *(bundle.lstm.layers if bundle.lstm else ())]
        return [part.tobytes() for layer in layers for part in vars(layer).values()]

    return weights(one) == weights(other)


def small_bundle() -> PolicyBundle:
    """Three inputs, two hidden units, two outputs, with weights that are easy to follow by hand."""
    layers = (
        Layer(np.array([[1, 0, 0], [0, 2, 0]], np.float32), np.array([0, 1], np.float32)),
        Layer(np.array([[1, 0], [1, -1]], np.float32), np.array([0.5, 0], np.float32)),
    )
    return PolicyBundle(
        network=MLP(layers, "relu"),
        squashing="clip",
        observation=LAYOUT,
        action_low=(-1.0, -1.0),
        action_high=(1.0, 1.0),
        env={"task": "target"},
        training={"decisions": 7},
    )


@pytest.fixture
def bundle() -> PolicyBundle:
    """The same, in a test of its own."""
    return small_bundle()


@pytest.fixture
def choosing(bundle) -> PolicyBundle:
    """The same as `bundle`, but for its last layer: it chooses one of 3 and one of 2 numbers."""
    rows = np.array([[0, 0], [1, 0], [0, 1], [2, 0], [0, 1]], np.float32)
    last = Layer(rows, np.array([0.5, 0, 0, 0, 0], np.float32))
    return replace(
        bundle,
        network=MLP((bundle.network.layers[0], last), "relu"),
        squashing="argmax",
        action_low=(0.0, -1.0),
        action_high=(2.0, 0.0),
    )


@pytest.fixture
def recurrent(bundle) -> PolicyBundle:
    """One that normalises its observations and remembers, with random weights."""
    return replace(
        bundle,
        lstm=LSTM(2 * random_lstm((3, 3), scale=1.0).layers),
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
    """One-step problem with a flat observation and a bounded action; only there to build models."""

    def __init__(self, size: int = 40, low: float = -1.0, high: float = 1.0) -> None:
        self.observation_space = gymnasium.spaces.Box(-10, 10, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(low, high, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        return self.observation_space.sample(), 0.0, True, False, {}


class ChoiceBandit(Bandit):
    """The same with a whole number of 16 and one of 8 as the action."""

    def __init__(self) -> None:
        super().__init__()
        self.action_space = gymnasium.spaces.MultiDiscrete([16, 8])


class DictBandit(Bandit):
    """The same with an observation in three parts."""

    def __init__(self) -> None:
        super().__init__()
        sizes = {"observation": 5, "desired_goal": 2, "achieved_goal": 2}
        self.observation_space = gymnasium.spaces.Dict(
            {name: gymnasium.spaces.Box(-10, 10, (n,), np.float32) for name, n in sizes.items()}
        )
