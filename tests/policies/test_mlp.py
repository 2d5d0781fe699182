from itertools import pairwise

import numpy as np
import pytest

from flyrl.policies.networks import MLP, Layer, check_layers, evaluate


def _layer(outputs: int, inputs: int) -> Layer:
    return Layer(np.zeros((outputs, inputs), np.float32), np.zeros(outputs, np.float32))


def test_outputs_by_hand():
    # hidden = relu([1*1 + 2*2 + 0.5, -1 - 1]) = [5.5, 0]; output = 2*5.5 + 3*0 - 1
    network = MLP(
        (
            Layer(np.array([[1, 2], [-1, 0]], np.float32), np.array([0.5, -1], np.float32)),
            Layer(np.array([[2, 3]], np.float32), np.array([-1], np.float32)),
        ),
        "relu",
    )
    inputs = np.array([[1.0, 2.0]])
    assert evaluate(inputs, np.array(network.sizes), network.packed(), False, False) == 10.0


@pytest.mark.parametrize("is_squashed", [False, True])
def test_tanh_between_layers_and_at_the_end(is_squashed):
    network = MLP((_unit(2.0), _unit(3.0)), "tanh")
    outputs = evaluate(
        np.array([[0.1]]), np.array(network.sizes), network.packed(), True, is_squashed
    )
    expected = 3 * np.tanh(0.2)
    np.testing.assert_allclose(outputs, np.tanh(expected) if is_squashed else expected, rtol=1e-7)


def _unit(weight: float) -> Layer:
    return Layer(np.array([[weight]], np.float32), np.zeros(1, np.float32))


def test_row_does_not_depend_on_its_neighbours():
    rng = np.random.default_rng(0)
    sizes = (37, 64, 64, 2)
    layers = tuple(
        Layer(rng.normal(size=(o, i)).astype(np.float32), rng.normal(size=o).astype(np.float32))
        for i, o in pairwise(sizes)
    )
    network = MLP(layers, "tanh")
    arguments = (np.array(sizes), network.packed(), True, True)
    inputs = rng.normal(size=(33, 37))
    together = evaluate(inputs, *arguments)
    for n in (1, 2, 7, 32):
        for start in range(0, 33 - n, n):
            rows = slice(start, start + n)
            np.testing.assert_array_equal(evaluate(inputs[rows], *arguments), together[rows])


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ([], "at least one layer"),
        ([_layer(4, 3), _layer(2, 5)], "layer 1 takes 5 inputs, but layer 0 gives 4"),
        ([Layer(np.zeros((2, 3), np.float32), np.zeros(3, np.float32))], "do not fit"),
    ],
)
def test_layers_that_do_not_fit(layers, message):
    with pytest.raises(ValueError, match=message):
        check_layers(layers)
