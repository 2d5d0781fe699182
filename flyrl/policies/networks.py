"""Networks in NumPy whose result for a row does not depend on the rows beside it.

A BLAS product may round a row differently when the batch has another size. `affine` takes the sums
of every row in one fixed order and in double precision, so that a policy acts the same to the bit
in the single and the batched environment.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from flyrl.validation import FloatArray, check_fields, float_array, positive

Weights = NDArray[np.float32]

Activation = Literal["tanh", "relu"]
_ACTIVATION_FUNCTIONS: Final[Mapping[Activation, Callable[[FloatArray], FloatArray]]] = {
    "tanh": np.tanh,
    "relu": lambda sums: np.maximum(sums, 0.0),
}


def affine(inputs: FloatArray, weight: Weights, bias: NDArray[Any]) -> FloatArray:
    """`weight @ row + bias` of every row of inputs (n, i): shape (n, outputs)."""
    sums = np.tile(bias.astype(np.float64), (len(inputs), 1))
    columns = np.array(weight.T, np.float64, order="C")
    for values, weights in zip(inputs.T[:, :, None], columns, strict=True):
        sums += values * weights
    return sums


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

    weight: Weights
    bias: Weights


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

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.layers:
            raise ValueError("a network has at least one layer, got none")
        outputs = None
        for i, layer in enumerate(self.layers):
            if layer.weight.ndim != 2 or layer.bias.shape != layer.weight.shape[:1]:
                raise ValueError(
                    f"layer {i}: weight {layer.weight.shape} and bias {layer.bias.shape} do not "
                    "fit; they are (outputs, inputs) and (outputs,)"
                )
            if outputs not in (None, inputs := layer.weight.shape[1]):
                raise ValueError(f"layer {i} takes {inputs} inputs, layer {i - 1} gives {outputs}")
            outputs = len(layer.bias)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of inputs, of units in every hidden layer, and of outputs."""
        return (self.layers[0].weight.shape[1], *(len(layer.bias) for layer in self.layers))

    def outputs(self, rows: FloatArray) -> FloatArray:
        """Outputs of the network for every row of inputs, (n, inputs): shape (n, outputs)."""
        for i, layer in enumerate(self.layers):
            inputs = _ACTIVATION_FUNCTIONS[self.activation](rows) if i else rows
            rows = affine(inputs, layer.weight, layer.bias)
        return rows


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

    input_weight: Weights
    recurrent_weight: Weights
    input_bias: Weights
    recurrent_bias: Weights


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
        if not self.layers:
            raise ValueError("an LSTM has at least one layer, got none")
        for i, layer in enumerate(self.layers):
            shapes = tuple(np.shape(part) for part in vars(layer).values())
            if not len(shapes[0]) == len(shapes[1]) == 2:
                raise ValueError(f"LSTM layer {i}: weights of shapes {shapes[:2]}; allowed: 2 axes")
            units = self.layers[0].recurrent_weight.shape[1]
            inputs = units if i else shapes[0][1]
            allowed = ((4 * units, inputs), (4 * units, units), (4 * units,), (4 * units,))
            if shapes != allowed:
                raise ValueError(f"LSTM layer {i}: shapes {shapes}; allowed: {allowed}")

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of inputs, and of the units of every layer."""
        units = [layer.recurrent_weight.shape[1] for layer in self.layers]
        return (self.layers[0].input_weight.shape[1], *units)

    def step(
        self, inputs: FloatArray, hidden: FloatArray, cell: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Hidden and cell state after a step of every row; the output is the last hidden state.

        Parameters
        ----------
        inputs
            Shape (n, inputs).
        hidden, cell
            State before the step, shape (layers, n, units) each.
        """
        hidden, cell = hidden.copy(), cell.copy()
        for i, layer in enumerate(self.layers):
            gates = affine(
                np.concatenate([hidden[i - 1] if i else inputs, hidden[i]], axis=1),
                np.concatenate([layer.input_weight, layer.recurrent_weight], axis=1),
                layer.input_bias.astype(np.float64) + layer.recurrent_bias,
            )
            let_in, keep, candidate, let_out = np.split(gates, 4, axis=1)
            cell[i] = expit(keep) * cell[i] + expit(let_in) * np.tanh(candidate)
            hidden[i] = expit(let_out) * np.tanh(cell[i])
        return hidden, cell


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

    mean: FloatArray
    variance: FloatArray
    epsilon: float
    clip: float

    def __post_init__(self) -> None:
        shape = (np.size(self.mean),)
        object.__setattr__(self, "mean", float_array("normaliser.mean", self.mean, shape))
        variance = float_array("normaliser.variance", self.variance, shape, minimum=0.0)
        object.__setattr__(self, "variance", variance)
        positive("normaliser.epsilon", self.epsilon)
        positive("normaliser.clip", self.clip)

    def apply(self, observations: FloatArray) -> FloatArray:
        """Normalised observations, (n, k), each value rounded to float32 as in training."""
        scaled = (observations - self.mean) / np.sqrt(self.variance + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32).astype(np.float64)


def vectors(observation: Any, sizes: Mapping[str, int] | None = None) -> FloatArray:
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
