"""A multilayer perceptron whose result for a row does not depend on the rows beside it.

A BLAS product may round a row differently when the batch has another size. These loops take every
row on its own, in one fixed order and in double precision, so that a policy acts the same to the
bit in the single and the batched environment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from flyrl.controllers.compilation import kernel

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
