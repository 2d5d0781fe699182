"""Policies as ONNX files, for whatever runs ONNX."""

import json
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

try:
    import onnx
    from onnx import TensorProto, helper, numpy_helper
except ImportError as error:
    raise ImportError("export_onnx needs the package onnx: pip install 'flyrl[onnx]'") from error

from flyrl.files import write_bytes
from flyrl.policies.bundle import PolicyBundle

_OPSET: Final = 17
_IR_VERSION: Final = 8
"""Of the year 2022: old enough for any runtime in use."""

_ACTIVATIONS: Final = {"tanh": "Tanh", "relu": "Relu"}


def export_onnx(bundle: PolicyBundle, path: Path) -> None:
    """Write the deterministic policy as an ONNX file, whole or not at all.

    The graph takes "observation", float32 (n, k), and gives "action", float32 (n, a), inside the
    bounds, for any n. The file's metadata say as JSON how the observation is laid out
    ("flyrl.observation"), what bounds the action has ("flyrl.action"), what the policy was trained
    in ("flyrl.env") and what training came to ("flyrl.training").

    Parameters
    ----------
    bundle
        The policy.
    path
        File to write (.onnx); an existing one is replaced.

    Raises
    ------
    ValueError
        A policy with a memory.
    """
    if bundle.lstm is not None:
        raise ValueError("lstm: LSTM; allowed: None (an ONNX file here holds no memory)")
    constants: dict[str, NDArray[np.float32]] = {
        "low": np.array(bundle.action_low, np.float32),
        "high": np.array(bundle.action_high, np.float32),
    }
    nodes = []
    value = "observation"
    if bundle.normaliser is not None:
        normaliser = bundle.normaliser
        constants |= {
            "mean": normaliser.mean.astype(np.float32),
            "scale": (1 / np.sqrt(normaliser.variance + normaliser.epsilon)).astype(np.float32),
            "least": np.array(-normaliser.clip, np.float32),
            "most": np.array(normaliser.clip, np.float32),
        }
        nodes += [
            helper.make_node("Sub", [value, "mean"], ["centred"]),
            helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
            helper.make_node("Clip", ["scaled", "least", "most"], ["normalised"]),
        ]
        value = "normalised"
    layers = bundle.network.layers
    for i, layer in enumerate(layers):
        constants[f"{i}.weight"], constants[f"{i}.bias"] = layer.weight, layer.bias
        inputs = [value, f"{i}.weight", f"{i}.bias"]
        value = f"{i}.sum"
        nodes.append(helper.make_node("Gemm", inputs, [value], transB=1))
        if i < len(layers) - 1:
            kind = _ACTIVATIONS[bundle.network.activation]
            nodes.append(helper.make_node(kind, [value], [f"{i}.unit"]))
            value = f"{i}.unit"
    if bundle.squashing == "tanh":
        # tanh runs from -1 to 1: half of the range on either side of its middle
        constants["middle"] = np.float32(0.5) * (constants["low"] + constants["high"])
        constants["half"] = np.float32(0.5) * (constants["high"] - constants["low"])
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
    sizes = bundle.network.sizes
    graph = helper.make_graph(
        nodes,
        "flyrl_policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["n", sizes[0]])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["n", sizes[-1]])],
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
