"""Networks against numbers worked out by hand, torch, and themselves in other batches."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from flyrl.policies.networks import LSTM, MLP, Layer, LSTMLayer, Normaliser, vectors
from tests.policies.conftest import Bandit, random_lstm, random_network


def _layer(weight, bias):
    return Layer(np.array(weight, np.float32), np.array(bias, np.float32))


def test_outputs_by_hand():
    # hidden = relu([1*1 + 2*2 + 0.5, -1 - 1]) = [5.5, 0]; output = 2*5.5 + 3*0 - 1
    network = MLP((_layer([[1, 2], [-1, 0]], [0.5, -1]), _layer([[2, 3]], [-1])), "relu")
    assert network.outputs(np.array([[1.0, 2.0]])) == 10.0


def test_tanh_is_between_layers_and_not_at_the_end():
    network = MLP((_layer([[2]], [0]), _layer([[3]], [0])), "tanh")
    np.testing.assert_allclose(network.outputs(np.array([[0.1]])), 3 * np.tanh(0.2), rtol=1e-14)


def _sigmoid(x):
    return 1 / (1 + np.exp(-x))


def test_one_lstm_unit_by_hand():
    # the rows are those of input gate, forget gate, candidate and output gate
    parts = ([[1], [0], [2], [0]], [[0], [1], [0], [2]], [0, 0.5, 0, 0], [0.5, 0, 0, 1])
    lstm = LSTM((LSTMLayer(*(np.array(part, np.float32) for part in parts)),))
    hidden, cell = lstm.step(np.array([[0.5]]), np.array([[[0.25]]]), np.array([[[3.0]]]))
    expected_cell = _sigmoid(0.25 + 0.5) * 3 + _sigmoid(0.5 + 0.5) * np.tanh(2 * 0.5)
    np.testing.assert_allclose(cell, expected_cell, rtol=1e-12)
    expected_hidden = _sigmoid(2 * 0.25 + 1) * np.tanh(expected_cell)
    np.testing.assert_allclose(hidden, expected_hidden, rtol=1e-12)


def test_an_lstm_is_that_of_torch():
    lstm = random_lstm((7, 5, 5, 5))
    module = nn.LSTM(7, 5, num_layers=3).double()
    for i, layer in enumerate(lstm.layers):
        for name, values in zip(
            ("weight_ih", "weight_hh", "bias_ih", "bias_hh"), vars(layer).values(), strict=True
        ):
            getattr(module, f"{name}_l{i}").data = torch.from_numpy(values).double()
    inputs = np.random.default_rng(1).normal(size=(20, 4, 7))
    hidden, cell = np.zeros((3, 4, 5)), np.zeros((3, 4, 5))
    outputs, (last_hidden, last_cell) = module(torch.from_numpy(inputs))
    for step in range(20):
        hidden, cell = lstm.step(inputs[step], hidden, cell)
        np.testing.assert_allclose(hidden[-1], outputs[step].detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(hidden, last_hidden.detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(cell, last_cell.detach(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 7, 32])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_row_does_not_depend_on_the_rows_beside_it(n, activation):
    network = random_network((37, 64, 64, 2), activation)
    inputs = np.random.default_rng(0).normal(size=(33, 37))
    together = network.outputs(inputs)
    for start in range(0, 33 - n, n):
        rows = slice(start, start + n)
        np.testing.assert_array_equal(network.outputs(inputs[rows]), together[rows])


@pytest.mark.parametrize("n", [1, 2, 7, 32])
def test_a_memory_does_not_depend_on_the_rows_beside_it(n):
    lstm, rng = random_lstm((37, 30, 30)), np.random.default_rng(0)
    given = [rng.normal(size=size) for size in ((33, 37), (2, 33, 30), (2, 33, 30))]
    rows = slice(1, 1 + n)
    alone = lstm.step(*(part[..., rows, :] for part in given))
    np.testing.assert_array_equal(alone, [part[:, rows] for part in lstm.step(*given)])


def test_layers_that_do_not_fit():
    for layers, message in (
        ((), "at least one layer"),
        (
            (_layer(np.zeros((4, 3)), np.zeros(4)), _layer(np.zeros((2, 5)), np.zeros(2))),
            "layer 1 takes 5 inputs, layer 0 gives 4",
        ),
        ((_layer(np.zeros((2, 3)), np.zeros(3)),), "do not fit"),
    ):
        with pytest.raises(ValueError, match=message):
            MLP(layers, "tanh")


def test_lstm_layers_that_do_not_fit():
    first, second = random_lstm((7, 5, 5)).layers
    for layers, message in (
        ((), "at least one layer"),
        ((first, first), r"LSTM layer 1: .*allowed: \(\(20, 5\)"),
        ((replace(first, input_bias=second.input_bias[:-1]),), "LSTM layer 0"),
        ((replace(first, recurrent_weight=np.zeros((), np.float32)),), "allowed: 2 axes"),
    ):
        with pytest.raises(ValueError, match=message):
            LSTM(layers)


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
