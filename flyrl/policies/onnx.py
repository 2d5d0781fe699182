"""Policies as ONNX files, for whatever runs ONNX."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.resources import install_command

try:
    import onnx
    from onnx import numpy_helper, parser
except ImportError as error:
    raise ImportError(f"export_onnx needs the package onnx: {install_command('onnx')}") from error

from flyrl.files import write_bytes
from flyrl.policies.bundle import PolicyBundle, bundle_record
from flyrl.policies.networks import LSTM_PARTS, Normaliser

# the version of the format is of the year 2022: old enough for any runtime in use
_MODEL: Final = """\
<ir_version: 8, opset_import: ["" : 17], producer_name: "flyrl">
flyrl_policy ({inputs}) => ({outputs}) {{
{nodes}
}}"""
"""A model in ONNX's text format; torch's own exporter would need onnxscript as well."""

_ACTIVATIONS: Final = {"tanh": "Tanh", "relu": "Relu"}


class _Graph:
    """Nodes, one a line of the text format, and the constants that they take."""

    def __init__(self) -> None:
        self.nodes: list[str] = []
        self.constants: dict[str, NDArray[Any]] = {}

    def add(self, *nodes: str, **constants: ArrayLike) -> None:
        self.nodes += nodes
        self.constants |= {name: np.asarray(value) for name, value in constants.items()}


def export_onnx(bundle: PolicyBundle, path: Path) -> None:
    """Write the deterministic policy as an ONNX file, whole or not at all.

    The graph takes "observation", float32 (n, k), and gives "action", float32 (n, a), inside the
    bounds, for any n. If the policy's actions are whole numbers, "action" is int64; where two
    numbers are nearly as good, rounding to float32 can choose the other one than the bundle does.

    If the policy has a memory, it also takes "hidden" and "cell", float32 (layers, n, units), zeros
    at first, and "episode_start", bool (n,): where one starts, the memory is set to zeros first. It
    then gives "next_hidden" and "next_cell" too, for the next step.

    The file's metadata say as JSON how the observation is laid out ("flyrl.observation"), what
    bounds the action has ("flyrl.action"), what the policy was trained in ("flyrl.env") and what
    training came to ("flyrl.training").

    Parameters
    ----------
    bundle
        The policy.
    path
        File to write (.onnx); an existing one is replaced.
    """
    graph, value = _Graph(), "observation"
    inputs = [f"float[n,{bundle.num_inputs}] observation"]
    kind = "int64" if bundle.squashing == "argmax" else "float"
    outputs = [f"{kind}[n,{len(bundle.action_low)}] action"]
    if bundle.normaliser is not None:
        value = _add_normaliser(graph, bundle.normaliser)
    if bundle.lstm_sizes:
        value = _add_lstm(graph, bundle, value)
        memory = f"float[{len(bundle.lstm_sizes) - 1},n,{bundle.lstm_sizes[-1]}]"
        inputs += [f"{memory} hidden", f"{memory} cell", "bool[n] episode_start"]
        outputs += [f"{memory} next_hidden", f"{memory} next_cell"]
    value = _add_network(graph, bundle, value)
    (_add_choices if kind == "int64" else _add_range)(graph, bundle, value)
    model = parser.parse_model(
        _MODEL.format(
            inputs=", ".join(inputs), outputs=", ".join(outputs), nodes="\n".join(graph.nodes)
        )
    )
    model.graph.initializer.extend(
        numpy_helper.from_array(array, name) for name, array in graph.constants.items()
    )
    record, shown = bundle_record(bundle), ("observation", "action", "env", "training")
    props = {f"flyrl.{key}": json.dumps(record[key]) for key in shown}
    onnx.helper.set_model_props(model, props)
    onnx.checker.check_model(model, full_check=True)
    write_bytes(path, model.SerializeToString())


def _add_normaliser(graph: _Graph, normaliser: Normaliser) -> str:
    mean = normaliser.mean.astype(np.float32)
    graph.add(
        # in two parts: one float32 is too coarse where the mean is large against its deviation
        "almost_centred = Sub(observation, mean)",
        "centred = Sub(almost_centred, rest_of_mean)",
        "scaled = Mul(centred, scale)",
        "normalised = Clip(scaled, least, most)",
        mean=mean,
        rest_of_mean=(normaliser.mean - mean).astype(np.float32),
        scale=(1 / np.sqrt(normaliser.variance + normaliser.epsilon)).astype(np.float32),
        least=np.float32(-normaliser.clip),
        most=np.float32(normaliser.clip),
    )
    return "normalised"


def _add_lstm(graph: _Graph, bundle: PolicyBundle, value: str) -> str:
    units, layers = bundle.lstm_sizes[-1], range(len(bundle.lstm_sizes) - 1)
    graph.add(
        "starts = Unsqueeze(episode_start, last_axis)",
        # a sequence of one step
        f"sequence = Unsqueeze({value}, first_axis)",
        zero=np.float32(0),
        first_axis=[0],
        last_axis=[1],
    )
    for state in ("hidden", "cell"):
        graph.add(
            f"kept_{state} = Where(starts, zero, {state})",
            f"{_listed(state, layers)} = Split<axis = 0>(kept_{state})",
        )
    value = "sequence"
    for i in layers:
        w, r, *biases = (bundle.weights[f"lstm.{i}.{part}"] for part in LSTM_PARTS)
        for part, array in (("W", w), ("R", r), ("B", np.concatenate(biases))):
            # ONNX wants the gates in the order input, output, forget, candidate
            gates = array.reshape(-1, 4, units, *array.shape[1:])[:, [0, 3, 1, 2]]
            graph.constants[f"{part}_{i}"] = gates.reshape(1, *array.shape)
        graph.add(
            f"all_{i}, next_hidden_{i}, next_cell_{i} = LSTM<hidden_size = {units}>"
            f"({value}, W_{i}, R_{i}, B_{i}, , hidden_{i}, cell_{i})"
        )
        value = f"next_hidden_{i}"
    for state in ("next_hidden", "next_cell"):
        graph.add(f"{state} = Concat<axis = 0>({_listed(state, layers)})")
    graph.add(f"remembered = Squeeze({value}, first_axis)")
    return "remembered"


def _add_network(graph: _Graph, bundle: PolicyBundle, value: str) -> str:
    for i in range(len(bundle.sizes) - 1):
        if i:
            graph.add(f"unit_{i} = {_ACTIVATIONS[bundle.activation]}({value})")
            value = f"unit_{i}"
        graph.add(f"sum_{i} = Gemm<transB = 1>({value}, weight_{i}, bias_{i})")
        for part in ("weight", "bias"):
            graph.constants[f"{part}_{i}"] = bundle.weights[f"{i}.{part}"]
        value = f"sum_{i}"
    return value


def _add_range(graph: _Graph, bundle: PolicyBundle, value: str) -> None:
    """From one output per component to "action"."""
    low, high = (np.array(b, np.float32) for b in (bundle.action_low, bundle.action_high))
    if bundle.squashing == "tanh":
        # tanh runs from -1 to 1: half of the range on either side of its middle
        graph.add(
            f"squashed = Tanh({value})",
            "stretched = Mul(squashed, half)",
            "shifted = Add(stretched, middle)",
            middle=np.float32(0.5) * (low + high),
            half=np.float32(0.5) * (high - low),
        )
        value = "shifted"
    graph.add(
        f"not_too_low = Max({value}, low)", "action = Min(not_too_low, high)", low=low, high=high
    )


def _add_choices(graph: _Graph, bundle: PolicyBundle, value: str) -> None:
    """From an output per whole number to "action"."""
    components = range(len(bundle.action_low))
    graph.add(
        f"{_listed('choice', components)} = Split<axis = 1>({value}, counts)",
        # of equals, ArgMax takes the first
        *(f"best_{i} = ArgMax<axis = 1>(choice_{i})" for i in components),
        f"best = Concat<axis = 1>({_listed('best', components)})",
        "action = Add(best, low)",
        counts=np.array(bundle.action_counts, np.int64),
        low=np.array(bundle.action_low, np.int64),
    )


def _listed(name: str, numbers: Iterable[int]) -> str:
    return ", ".join(f"{name}_{i}" for i in numbers)
