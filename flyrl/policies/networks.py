"""Networks in Numba whose result for a row does not depend on the rows beside it.

A BLAS product may round a row differently when the batch has another size. These loops take every
row on its own, in one fixed order and in double precision, so that a policy acts the same to the
bit in the single and the batched environment.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from flyrl.controllers.compilation import kernel
from flyrl.validation import float_array, positive

Activation = Literal["tanh", "relu"]
ACTIVATIONS: Final[tuple[Activation, ...]] = get_args(Activation)


@dataclass(frozen=True, eq=False)
class Layer:
    """One affine map, x -> weight @ x + bias.

    Attributes
    ----------
    weight
        float32, shape (outputs, inputs).
    bias
        float32, shape (outputs,).
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class MLP:
    """Layers with an activation between them, and none after the last one.

    Attributes
    ----------
    layers
        In order from observation to action.
    activation
        Function between two layers.
    """

    layers: tuple[Layer, ...]
    activation: Activation

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of inputs, of units in every hidden layer, and of outputs."""
        return (self.layers[0].weight.shape[1], *(len(layer.bias) for layer in self.layers))

    def packed(self) -> NDArray[np.float64]:
        """All parameters in the order in which `evaluate` reads them: shape (p,)."""
        return np.concatenate(
            [part for layer in self.layers for part in (layer.weight.T.ravel(), layer.bias)],
            dtype=np.float64,
        )


def check_layers(layers: Sequence[Layer]) -> None:
    """Raise ValueError unless every layer takes what the one before it gives."""
    if not layers:
        raise ValueError("a network has at least one layer, got none")
    for i, layer in enumerate(layers):
        if layer.weight.ndim != 2 or layer.bias.shape != layer.weight.shape[:1]:
            raise ValueError(
                f"layer {i}: weight {layer.weight.shape} and bias {layer.bias.shape} do not fit; "
                "they are (outputs, inputs) and (outputs,)"
            )
        if i and layer.weight.shape[1] != len(layers[i - 1].bias):
            raise ValueError(
                f"layer {i} takes {layer.weight.shape[1]} inputs, "
                f"but layer {i - 1} gives {len(layers[i - 1].bias)}"
            )


@kernel
def evaluate(
    inputs: NDArray[np.float64],
    sizes: NDArray[np.int64],
    parameters: NDArray[np.float64],
    is_tanh: bool,
    is_squashed: bool,
) -> NDArray[np.float64]:
    """Outputs of the network for every row of `inputs`.

    Parameters
    ----------
    inputs
        Shape (n, sizes[0]).
    sizes
        As `MLP.sizes`.
    parameters
        As `MLP.packed()`.
    is_tanh
        Whether the activation is tanh; else it is relu.
    is_squashed
        Whether tanh is taken of the outputs too.

    Returns
    -------
    Shape (n, sizes[-1]).
    """
    outputs = np.empty((len(inputs), sizes[-1]))
    units = np.empty(sizes.max())
    sums = np.empty(sizes.max())
    for row in range(len(inputs)):
        for j in range(sizes[0]):
            units[j] = inputs[row, j]
        offset = 0
        for layer in range(len(sizes) - 1):
            num_inputs, num_outputs = sizes[layer], sizes[layer + 1]
            bias = offset + num_inputs * num_outputs
            for k in range(num_outputs):
                sums[k] = parameters[bias + k]
            for j in range(num_inputs):
                unit = units[j]
                weights = offset + j * num_outputs
                for k in range(num_outputs):
                    sums[k] += unit * parameters[weights + k]
            offset = bias + num_outputs
            is_last = layer == len(sizes) - 2
            for k in range(num_outputs):
                if is_squashed if is_last else is_tanh:
                    units[k] = np.tanh(sums[k])
                else:
                    units[k] = sums[k] if is_last else max(sums[k], 0.0)
        for k in range(sizes[-1]):
            outputs[row, k] = units[k]
    return outputs


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


@dataclass(frozen=True, eq=False)
class Normaliser:
    """Statistics of the observations that a policy was trained on.

    Attributes
    ----------
    mean, variance
        Of every value of the observation, shape (k,) each.
    epsilon
        Added to the variance.
    clip
        Normalised values lie within this of 0.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    epsilon: float
    clip: float

    def __post_init__(self) -> None:
        shape = (np.size(self.mean),)
        object.__setattr__(self, "mean", float_array("normaliser.mean", self.mean, shape))
        variance = float_array("normaliser.variance", self.variance, shape, minimum=0.0)
        object.__setattr__(self, "variance", variance)
        positive("normaliser.epsilon", self.epsilon)
        positive("normaliser.clip", self.clip)

    def apply(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalised observations, (n, k), each value rounded to float32 as in training."""
        scaled = (observations - self.mean) / np.sqrt(self.variance + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32).astype(np.float64)


def vectors(observation: Any, sizes: Mapping[str, int] | None = None) -> NDArray[np.float64]:
    """An observation, or a batch, as one array.

    Parameters
    ----------
    observation
        An array (..., k), or a dict of such arrays. Those are put side by side in the order of
        their names, as Stable-Baselines3's CombinedExtractor and `gymnasium.spaces.flatten` do.
    sizes
        Numbers of values by name, of a dict whose arrays have rows and columns.

    Raises
    ------
    ValueError
        Arrays of a dict that do not fit.
    """
    if isinstance(observation, Mapping):
        parts = {name: np.asarray(observation[name], np.float64) for name in sorted(observation)}
        if sizes and sizes.keys() == parts.keys():
            is_batch = all(
                part.size != sizes[name] or len(part) == 1 for name, part in parts.items()
            )
            parts = {
                name: part.reshape((-1, sizes[name]) if is_batch else -1)
                for name, part in parts.items()
            }
        return np.concatenate([*parts.values()], axis=-1)
    return np.asarray(observation, dtype=np.float64)
