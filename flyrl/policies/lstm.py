"""LSTM layers whose result for a row does not depend on the rows beside it; see `mlp`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flyrl.controllers.compilation import kernel


@dataclass(frozen=True, eq=False)
class LSTMLayer:
    """One layer of h units (Hochreiter and Schmidhuber 1997), with PyTorch's parameters.

    The rows are those of the input gate, the forget gate, the candidate and the output gate, h of
    each.

    Attributes
    ----------
    input_weight
        float32, shape (4 h, inputs).
    recurrent_weight
        float32, shape (4 h, h).
    input_bias, recurrent_bias
        float32, shape (4 h,) each; they are added up.
    """

    input_weight: NDArray[np.float32]
    recurrent_weight: NDArray[np.float32]
    input_bias: NDArray[np.float32]
    recurrent_bias: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LSTM:
    """Layers of equal width, each of which takes the hidden state of the one before it.

    Attributes
    ----------
    layers
        In order from the observation.
    """

    layers: tuple[LSTMLayer, ...]

    def __post_init__(self) -> None:
        _check_layers(self.layers)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of inputs, and of the units of every layer."""
        units = [layer.recurrent_weight.shape[1] for layer in self.layers]
        return (self.layers[0].input_weight.shape[1], *units)

    def packed(self) -> NDArray[np.float64]:
        """All parameters in the order in which `advance` reads them: shape (p,)."""
        parts = [
            part
            for layer in self.layers
            for part in (
                layer.input_weight.T.ravel(),
                layer.recurrent_weight.T.ravel(),
                layer.input_bias.astype(np.float64) + layer.recurrent_bias,
            )
        ]
        return np.concatenate(parts, dtype=np.float64)


def _check_layers(layers: Sequence[LSTMLayer]) -> None:
    """Raise ValueError unless every layer takes what the one before it gives."""
    if not layers:
        raise ValueError("an LSTM has at least one layer, got none")
    for i, layer in enumerate(layers):
        if not layer.input_weight.ndim == layer.recurrent_weight.ndim == 2:
            raise ValueError(
                f"LSTM layer {i}: weights of shapes {layer.input_weight.shape} and "
                f"{layer.recurrent_weight.shape}; allowed: two axes each"
            )
        units = layers[0].recurrent_weight.shape[1]
        inputs = layer.input_weight.shape[1] if i == 0 else units
        shapes = (
            layer.input_weight.shape,
            layer.recurrent_weight.shape,
            layer.input_bias.shape,
            layer.recurrent_bias.shape,
        )
        allowed = ((4 * units, inputs), (4 * units, units), (4 * units,), (4 * units,))
        if shapes != allowed:
            raise ValueError(f"LSTM layer {i}: parameters of shapes {shapes}; allowed: {allowed}")


@kernel
def advance(
    inputs: NDArray[np.float64],
    hidden: NDArray[np.float64],
    cell: NDArray[np.float64],
    parameters: NDArray[np.float64],
) -> None:
    """Let every row take one step; its output is the last layer's new hidden state.

    Parameters
    ----------
    inputs
        Shape (n, inputs).
    hidden, cell
        State, shape (layers, n, units) each; overwritten by the new one.
    parameters
        As `LSTM.packed()`.
    """
    num_layers, num_rows, num_units = hidden.shape
    num_gates = 4 * num_units
    gates = np.empty(num_gates)
    for row in range(num_rows):
        offset = 0
        for layer in range(num_layers):
            below = inputs[row] if layer == 0 else hidden[layer - 1, row]
            own = hidden[layer, row]
            bias = offset + (len(below) + num_units) * num_gates
            for k in range(num_gates):
                gates[k] = parameters[bias + k]
            for j in range(len(below) + num_units):
                value = below[j] if j < len(below) else own[j - len(below)]
                weights = offset + j * num_gates
                for k in range(num_gates):
                    gates[k] += value * parameters[weights + k]
            offset = bias + num_gates
            for k in range(num_units):
                let_in = 1 / (1 + np.exp(-gates[k]))
                keep = 1 / (1 + np.exp(-gates[num_units + k]))
                candidate = np.tanh(gates[2 * num_units + k])
                let_out = 1 / (1 + np.exp(-gates[3 * num_units + k]))
                cell[layer, row, k] = keep * cell[layer, row, k] + let_in * candidate
                own[k] = let_out * np.tanh(cell[layer, row, k])
