"""Networks against numbers worked out by hand, torch, and themselves in other batches."""

from itertools import product

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.policies.networks import LSTM_PARTS, Normaliser, lstm_step, mlp, vectors
from tests.policies.conftest import Bandit, random_network


def arrays(weights):
    """Weights of lists."""
    return {name: np.array(values, np.float32) for name, values in weights.items()}


def test_outputs_by_hand():
    # hidden = relu([1*1 + 2*2 + 0.5, -1 - 1]) = [5.5, 0]; output = 2*5.5 + 3*0 - 1
    hidden = {"0.weight": [[1, 2], [-1, 0]], "0.bias": [0.5, -1]}
    weights = arrays(hidden | {"1.weight": [[2, 3]], "1.bias": [-1]})
    assert mlp(weights, 2, "relu", np.array([[1.0, 2.0]])) == 10.0


def test_tanh_is_between_layers_and_not_at_the_end():
    weights = arrays({"0.weight": [[2]], "0.bias": [0], "1.weight": [[3]], "1.bias": [0]})
    outputs = mlp(weights, 2, "tanh", np.array([[0.1]]))
    np.testing.assert_allclose(outputs, 3 * np.tanh(0.2), rtol=1e-14)


def _sigmoid(x):
    return 1 / (1 + np.exp(-x))


def test_one_lstm_unit_by_hand():
    # the rows are those of input gate, forget gate, candidate and output gate
    parts = ([[1], [0], [2], [0]], [[0], [1], [0], [2]], [0, 0.5, 0, 0], [0.5, 0, 0, 1])
    weights = arrays({f"lstm.0.{n}": part for n, part in zip(LSTM_PARTS, parts, strict=True)})
    hidden, cell = lstm_step(weights, np.array([[0.5]]), np.array([[[0.25]]]), np.array([[[3.0]]]))
    expected_cell = _sigmoid(0.25 + 0.5) * 3 + _sigmoid(0.5 + 0.5) * np.tanh(2 * 0.5)
    np.testing.assert_allclose(cell, expected_cell, rtol=1e-12)
    expected_hidden = _sigmoid(2 * 0.25 + 1) * np.tanh(expected_cell)
    np.testing.assert_allclose(hidden, expected_hidden, rtol=1e-12)


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


@pytest.mark.parametrize("n", [1, 2, 7, 32])
def test_a_row_does_not_depend_on_the_rows_beside_it(n):
    rng = np.random.default_rng(0)
    weights = random_network((37, 64, 64, 2), lstm_sizes=(37, 30, 30))["weights"]
    inputs, *memory = (rng.normal(size=size) for size in ((33, 37), (2, 33, 30), (2, 33, 30)))
    remembered = lstm_step(weights, inputs, *memory)
    outputs = {name: mlp(weights, 3, name, inputs) for name in ("tanh", "relu")}
    for start in range(0, 33 - n, n):
        rows = slice(start, start + n)
        for activation, together in outputs.items():
            alone = mlp(weights, 3, activation, inputs[rows])
            np.testing.assert_array_equal(alone, together[rows])
        alone = lstm_step(weights, inputs[rows], *(part[:, rows] for part in memory))
        np.testing.assert_array_equal(alone, [part[:, rows] for part in remembered])


def test_normalised_by_hand():
    normaliser = Normaliser(np.array([1.0, 0.0]), np.array([3.0, 0.0]), epsilon=1.0, clip=2.5)
    observations = np.array([[5.0, 3.0], [-1.0, -2.0]])
    # (5 - 1) / 2, 3 clipped; (-1 - 1) / 2, -2
    np.testing.assert_array_equal(normaliser.apply(observations), [[2.0, 2.5], [-1.0, -2.0]])


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
    for row, values in zip(observations, normalised, strict=True):
        np.testing.assert_array_equal(normaliser.apply(row[None].astype(np.float64))[0], values)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"variance": [1.0, -1.0]}, r"normaliser\.variance must be at least 0"),
        ({"epsilon": 0.0}, r"normaliser\.epsilon must be a finite number above 0, got 0\.0"),
        ({"clip": -1.0}, r"normaliser\.clip must be a finite number above 0, got -1\.0"),
    ],
)
def test_bad_statistics(changes, message):
    arguments = {"mean": [0.0, 0.0], "variance": [1.0, 1.0], "epsilon": 1e-8, "clip": 10.0}
    with pytest.raises(ValueError, match=message):
        Normaliser(**arguments | changes)


def test_parts_of_a_dict_stand_side_by_side_in_the_order_of_their_names():
    parts = {"b": np.array([[3.0], [6.0]]), "a": np.array([[1, 2], [4, 5]], np.float32)}
    np.testing.assert_array_equal(vectors(parts), [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(vectors({"b": [3.0], "a": [1.0]}), [1, 3])
    with pytest.raises(ValueError, match="must match exactly"):
        vectors({"a": np.zeros((2, 1)), "b": np.zeros((3, 1))})
