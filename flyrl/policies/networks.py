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

from flyrl.validation import FloatArray, float_array, positive

Weights = NDArray[np.float32]

Activation = Literal["tanh", "relu"]
_ACTIVATION_FUNCTIONS: Final[Mapping[Activation, Callable[[FloatArray], FloatArray]]] = {
    "tanh": np.tanh,
    "relu": lambda sums: np.maximum(sums, 0.0),
}


LSTM_PARTS: Final = ("input_weight", "recurrent_weight", "input_bias", "recurrent_bias")
"""Names of a layer's weights."""


def affine(inputs: FloatArray, weight: Weights, bias: NDArray[Any]) -> FloatArray:
    """`weight @ row + bias` of every row of inputs (n, i): shape (n, outputs)."""
    sums = np.tile(bias.astype(np.float64), (len(inputs), 1))
    columns = np.array(weight.T, np.float64, order="C")
    for values, weights in zip(inputs.T[:, :, None], columns, strict=True):
        sums += values * weights
    return sums


def mlp(
    weights: Mapping[str, Weights], num_layers: int, activation: Activation, rows: FloatArray
) -> FloatArray:
    """Outputs of a network for every row of inputs, (n, inputs): shape (n, outputs).

    Parameters
    ----------
    weights
        Those of layer i are "i.weight", float32, shape (outputs, inputs), and "i.bias", (outputs,).
    num_layers
        An activation lies between two of them, and none after the last one.
    activation
        Function between two layers.
    rows
        Inputs.
    """
    for i in range(num_layers):
        inputs = _ACTIVATION_FUNCTIONS[activation](rows) if i else rows
        rows = affine(inputs, weights[f"{i}.weight"], weights[f"{i}.bias"])
    return rows


def lstm_step(
    weights: Mapping[str, Weights], inputs: FloatArray, hidden: FloatArray, cell: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Hidden and cell state of an LSTM after a step; the output is the last layer's hidden state.

    Layers of h units each (Hochreiter and Schmidhuber 1997), with PyTorch's parameters.

    Parameters
    ----------
    weights
        Those of layer i are "lstm.i.input_weight", float32, shape (4 h, inputs),
        "lstm.i.recurrent_weight", (4 h, h), "lstm.i.input_bias" and "lstm.i.recurrent_bias", (4 h,)
        each, which are added up. The rows are those of the input gate, the forget gate, the
        candidate and the output gate, h of each.
    inputs
        Shape (n, inputs).
    hidden, cell
        State before the step, shape (layers, n, h) each.
    """
    hidden, cell = hidden.copy(), cell.copy()
    for i in range(len(hidden)):
        input_weight, recurrent_weight, input_bias, recurrent_bias = (
            weights[f"lstm.{i}.{part}"] for part in LSTM_PARTS
        )
        gates = affine(
            np.concatenate([hidden[i - 1] if i else inputs, hidden[i]], axis=1),
            np.concatenate([input_weight, recurrent_weight], axis=1),
            input_bias.astype(np.float64) + recurrent_bias,
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
