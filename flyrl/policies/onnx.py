"""Policies as ONNX files, for whatever runs ONNX."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.resources import install_command

try:
    import onnx
    from onnx import TensorProto, helper, numpy_helper
except ImportError as error:
    raise ImportError(f"export_onnx needs the package onnx: {install_command('onnx')}") from error

from flyrl.files import write_bytes
from flyrl.policies.bundle import PolicyBundle
from flyrl.policies.networks import LSTM

_OPSET: Final = 17
_IR_VERSION: Final = 8
"""Of the year 2022: old enough for any runtime in use."""

_ACTIVATIONS: Final = {"tanh": "Tanh", "relu": "Relu"}

_Part = tuple[list[onnx.NodeProto], dict[str, NDArray[Any]]]
"""Nodes of a graph, and the constants that they take."""


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
    is_integer = bundle.squashing == "argmax"
    constants: dict[str, NDArray[Any]] = {}
    nodes = []
    value = "observation"
    if bundle.normaliser is not None:
        normaliser = bundle.normaliser
        constants |= {
            "mean": (mean := normaliser.mean.astype(np.float32)),
            "rest_of_mean": (normaliser.mean - mean).astype(np.float32),
            "scale": (1 / np.sqrt(normaliser.variance + normaliser.epsilon)).astype(np.float32),
            "least": np.array(-normaliser.clip, np.float32),
            "most": np.array(normaliser.clip, np.float32),
        }
        nodes += [
            # in two parts: one float32 is too coarse where the mean is large against its deviation
            helper.make_node("Sub", [value, "mean"], ["almost_centred"]),
            helper.make_node("Sub", ["almost_centred", "rest_of_mean"], ["centred"]),
            helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
            helper.make_node("Clip", ["scaled", "least", "most"], ["normalised"]),
        ]
        value = "normalised"
    kind_of_action = TensorProto.INT64 if is_integer else TensorProto.FLOAT
    inputs = [_value("observation", "n", bundle.num_inputs)]
    outputs = [_value("action", "n", len(bundle.action_low), kind=kind_of_action)]
    if bundle.lstm is not None:
        lstm_nodes, lstm_constants = _lstm(bundle.lstm, value)
        nodes += lstm_nodes
        constants |= lstm_constants
        value = "remembered"
        memory = (len(bundle.lstm.layers), "n", bundle.lstm.sizes[-1])
        inputs += [_value(name, *memory) for name in ("hidden", "cell")]
        inputs.append(_value("episode_start", "n", kind=TensorProto.BOOL))
        outputs += [_value(f"next_{name}", *memory) for name in ("hidden", "cell")]
    layers = bundle.network.layers
    for i, layer in enumerate(layers):
        constants[f"{i}.weight"], constants[f"{i}.bias"] = layer.weight, layer.bias
        nodes.append(
            helper.make_node("Gemm", [value, f"{i}.weight", f"{i}.bias"], [f"{i}.sum"], transB=1)
        )
        value = f"{i}.sum"
        if i < len(layers) - 1:
            kind = _ACTIVATIONS[bundle.network.activation]
            nodes.append(helper.make_node(kind, [value], [f"{i}.unit"]))
            value = f"{i}.unit"
    action_nodes, action_constants = (_choices if is_integer else _range)(bundle, value)
    nodes += action_nodes
    constants |= action_constants
    graph = helper.make_graph(
        nodes,
        "flyrl_policy",
        inputs,
        outputs,
        [numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    model = helper.make_model(
        graph,
        ir_version=_IR_VERSION,
        opset_imports=[helper.make_opsetid("", _OPSET)],
        producer_name="flyrl",
    )
    helper.set_model_props(
        model,
        {
            "flyrl.observation": json.dumps(
                [{"name": term.name, "size": term.size} for term in bundle.observation]
            ),
            "flyrl.action": json.dumps({"low": bundle.action_low, "high": bundle.action_high}),
            "flyrl.env": json.dumps(bundle.env),
            "flyrl.training": json.dumps(bundle.training),
        },
    )
    onnx.checker.check_model(model, full_check=True)
    write_bytes(path, model.SerializeToString())


def _value(name: str, *shape: int | str, kind: int = TensorProto.FLOAT) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, shape)


def _range(bundle: PolicyBundle, value: str) -> _Part:
    """Nodes and constants from `value` to "action", one output per component."""
    low, high = (np.array(b, np.float32) for b in (bundle.action_low, bundle.action_high))
    constants: dict[str, NDArray[Any]] = {"low": low, "high": high}
    nodes = []
    if bundle.squashing == "tanh":
        # tanh runs from -1 to 1: half of the range on either side of its middle
        constants["middle"] = np.float32(0.5) * (low + high)
        constants["half"] = np.float32(0.5) * (high - low)
        nodes += [
            helper.make_node("Tanh", [value], ["squashed"]),
            helper.make_node("Mul", ["squashed", "half"], ["stretched"]),
            helper.make_node("Add", ["stretched", "middle"], ["shifted"]),
        ]
        value = "shifted"
    nodes += [
        helper.make_node("Max", [value, "low"], ["not_too_low"]),
        helper.make_node("Min", ["not_too_low", "high"], ["action"]),
    ]
    return nodes, constants


def _choices(bundle: PolicyBundle, value: str) -> _Part:
    """Nodes and constants from `value` to "action", an output per whole number."""
    counts = np.array(bundle.action_counts, np.int64)
    constants: dict[str, NDArray[Any]] = {
        "counts": counts,
        "low": np.array(bundle.action_low, np.int64),
    }
    parts = [f"choice.{i}" for i in range(len(counts))]
    nodes = [
        helper.make_node("Split", [value, "counts"], parts, axis=1),
        # of equals, ArgMax takes the first
        *(helper.make_node("ArgMax", [part], [f"{part}.best"], axis=1) for part in parts),
        helper.make_node("Concat", [f"{part}.best" for part in parts], ["best"], axis=1),
        helper.make_node("Add", ["best", "low"], ["action"]),
    ]
    return nodes, constants


def _lstm(lstm: LSTM, value: str) -> _Part:
    """Nodes and constants from `value` to "remembered", the last layer's output."""
    units = lstm.sizes[-1]
    constants: dict[str, NDArray[Any]] = {
        "zero": np.array(0, np.float32),
        "first_axis": np.array([0]),
        "last_axis": np.array([1]),
    }
    nodes = [
        helper.make_node("Unsqueeze", ["episode_start", "last_axis"], ["starts"]),
        # a sequence of one step
        helper.make_node("Unsqueeze", [value, "first_axis"], ["sequence"]),
    ]
    names = [f"lstm.{i}" for i in range(len(lstm.layers))]
    for state in ("hidden", "cell"):
        nodes += [
            helper.make_node("Where", ["starts", "zero", state], [f"kept_{state}"]),
            helper.make_node("Split", [f"kept_{state}"], [f"{n}.{state}" for n in names], axis=0),
        ]
    value = "sequence"
    for name, layer in zip(names, lstm.layers, strict=True):
        bias = np.concatenate([layer.input_bias, layer.recurrent_bias])
        parts = {"W": layer.input_weight, "R": layer.recurrent_weight, "B": bias}
        for part, array in parts.items():
            # ONNX wants the gates in the order input, output, forget, candidate
            gates = array.reshape(-1, 4, units, *array.shape[1:])[:, [0, 3, 1, 2]]
            constants[f"{name}.{part}"] = gates.reshape(1, *array.shape)
        weights = [f"{name}.{part}" for part in parts]
        taken = [value, *weights, "", f"{name}.hidden", f"{name}.cell"]
        given = ["", f"{name}.next_hidden", f"{name}.next_cell"]
        nodes.append(helper.make_node("LSTM", taken, given, hidden_size=units))
        value = f"{name}.next_hidden"
    for state in ("next_hidden", "next_cell"):
        nodes.append(helper.make_node("Concat", [f"{n}.{state}" for n in names], [state], axis=0))
    nodes.append(helper.make_node("Squeeze", [value, "first_axis"], ["remembered"]))
    return nodes, constants
