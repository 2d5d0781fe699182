from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from flyrl.policies.networks import LSTM, LSTMLayer, advance


def _random(sizes, seed=0):
    rng = np.random.default_rng(seed)
    layers = []
    for i in range(len(sizes) - 1):
        units = sizes[i + 1]
        shapes = ((4 * units, sizes[i]), (4 * units, units), (4 * units,), (4 * units,))
        layers.append(LSTMLayer(*(rng.normal(0, 0.5, s).astype(np.float32) for s in shapes)))
    return LSTM(tuple(layers))


def _sigmoid(x):
    return 1 / (1 + np.exp(-x))


def test_one_unit_by_hand():
    # the rows are those of input gate, forget gate, candidate and output gate
    lstm = LSTM(
        (
            LSTMLayer(
                np.array([[1], [0], [2], [0]], np.float32),
                np.array([[0], [1], [0], [2]], np.float32),
                np.array([0, 0.5, 0, 0], np.float32),
                np.array([0.5, 0, 0, 1], np.float32),
            ),
        )
    )
    hidden, cell = np.array([[[0.25]]]), np.array([[[3.0]]])
    advance(np.array([[0.5]]), hidden, cell, lstm.packed())
    expected_cell = _sigmoid(0.25 + 0.5) * 3 + _sigmoid(0.5 + 0.5) * np.tanh(2 * 0.5)
    np.testing.assert_allclose(cell, expected_cell, rtol=1e-12)
    expected_hidden = _sigmoid(2 * 0.25 + 1) * np.tanh(expected_cell)
    np.testing.assert_allclose(hidden, expected_hidden, rtol=1e-12)


def test_as_in_torch():
    lstm = _random((7, 5, 5, 5))
    module = nn.LSTM(7, 5, num_layers=3).double()
    for i, layer in enumerate(lstm.layers):
        for name, values in (
            ("weight_ih", layer.input_weight),
            ("weight_hh", layer.recurrent_weight),
            ("bias_ih", layer.input_bias),
            ("bias_hh", layer.recurrent_bias),
        ):
            getattr(module, f"{name}_l{i}").data = torch.from_numpy(values).double()
    inputs = np.random.default_rng(1).normal(size=(20, 4, 7))
    hidden, cell = np.zeros((3, 4, 5)), np.zeros((3, 4, 5))
    outputs, (last_hidden, last_cell) = module(torch.from_numpy(inputs))
    for step in range(20):
        advance(inputs[step], hidden, cell, lstm.packed())
        np.testing.assert_allclose(hidden[-1], outputs[step].detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(hidden, last_hidden.detach(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(cell, last_cell.detach(), rtol=0, atol=1e-12)


def test_row_does_not_depend_on_its_neighbours():
    lstm = _random((37, 32, 32))
    rng = np.random.default_rng(0)
    inputs, hidden, cell = (rng.normal(size=s) for s in ((33, 37), (2, 33, 32), (2, 33, 32)))
    before = hidden.copy(), cell.copy()
    advance(inputs, hidden, cell, lstm.packed())
    for n in (1, 2, 7, 32):
        rows = slice(3, 3 + n)
        own = [np.ascontiguousarray(part[:, rows]) for part in before]
        advance(inputs[rows], *own, lstm.packed())
        np.testing.assert_array_equal(own[0], hidden[:, rows])
        np.testing.assert_array_equal(own[1], cell[:, rows])


def test_sizes():
    assert _random((7, 5, 5)).sizes == (7, 5, 5)


def test_layers_that_do_not_fit():
    with pytest.raises(ValueError, match="at least one layer"):
        LSTM(())
    first, second = _random((7, 5, 5)).layers
    with pytest.raises(ValueError, match=r"LSTM layer 1: .*allowed: \(\(20, 5\)"):
        LSTM((first, first))
    with pytest.raises(ValueError, match="LSTM layer 0"):
        LSTM((replace(first, input_bias=second.input_bias[:-1]),))
    with pytest.raises(ValueError, match="LSTM layer 0"):
        LSTM((replace(first, recurrent_weight=np.zeros(5, np.float32)),))
    with pytest.raises(ValueError, match=r"LSTM layer 0: .* \(\); allowed: two axes each"):
        LSTM((replace(first, recurrent_weight=np.zeros((), np.float32)),))
