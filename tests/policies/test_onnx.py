import json
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest

from flyrl.policies import LearnedPolicy, TermLayout, export_onnx
from flyrl.policies.normaliser import Normaliser
from tests.policies.conftest import random_network


@pytest.fixture(params=[("tanh", "clip"), ("relu", "clip"), ("tanh", "tanh"), ("relu", "tanh")])
def policy(request, bundle):
    """As large as a trained one, with outputs that reach the bounds."""
    activation, squashing = request.param
    return replace(
        bundle,
        network=random_network((40, 64, 64, 2), activation),
        squashing=squashing,
        observation=(TermLayout("all", 40),),
        action_low=(-0.5, -1.0),
        action_high=(1.5, 0.5),
    )


def _run(path, observations):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(["action"], {"observation": observations})[0]


@pytest.mark.parametrize("n", [1, 500])
def test_onnxruntime_gives_the_same_actions(policy, n, tmp_path):
    export_onnx(policy, tmp_path / "policy.onnx")
    observations = np.random.default_rng(1).normal(size=(n, 40)).astype(np.float32)
    actions = _run(tmp_path / "policy.onnx", observations)
    expected, _ = LearnedPolicy(policy).predict(observations)
    assert actions.dtype == np.float32
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)
    if n > 1:
        assert np.ptp(expected) > 1


def test_observations_are_normalised_as_by_the_policy(policy, tmp_path):
    rng = np.random.default_rng(2)
    normaliser = Normaliser(rng.normal(size=40), rng.uniform(0.1, 4, 40), 1e-8, 1.5)
    policy = replace(policy, normaliser=normaliser)
    export_onnx(policy, tmp_path / "policy.onnx")
    observations = rng.normal(size=(200, 40)).astype(np.float32)
    expected, _ = LearnedPolicy(policy).predict(observations)
    plain, _ = LearnedPolicy(replace(policy, normaliser=None)).predict(observations)
    assert np.abs(expected - plain).max() > 0.1
    actions = _run(tmp_path / "policy.onnx", observations)
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)


def test_a_policy_with_a_memory_is_refused(recurrent, tmp_path):
    with pytest.raises(ValueError, match="lstm: LSTM; allowed: None"):
        export_onnx(recurrent, tmp_path / "policy.onnx")
    assert not any(tmp_path.iterdir())


def test_actions_stay_inside_their_bounds(policy, tmp_path):
    export_onnx(policy, tmp_path / "policy.onnx")
    extreme = np.random.default_rng(1).normal(scale=1e6, size=(200, 40)).astype(np.float32)
    actions = _run(tmp_path / "policy.onnx", extreme)
    assert (actions >= np.float32(policy.action_low)).all()
    assert (actions <= np.float32(policy.action_high)).all()


def test_file_says_what_it_is(bundle, tmp_path):
    export_onnx(bundle, tmp_path / "policy.onnx")
    model = onnx.load(tmp_path / "policy.onnx")
    record = {prop.key: json.loads(prop.value) for prop in model.metadata_props}
    assert record == {
        "flyrl.observation": [{"name": "bearing", "size": 2}, {"name": "speed", "size": 1}],
        "flyrl.action": {"low": [-1, -1], "high": [1, 1]},
        "flyrl.env": {"task": "target"},
        "flyrl.training": {"decisions": 7},
    }


def test_file_holds_standard_operators_only(policy, tmp_path):
    export_onnx(policy, tmp_path / "policy.onnx")
    model = onnx.load(tmp_path / "policy.onnx")
    assert {node.domain for node in model.graph.node} == {""}
    assert not model.functions
    assert {node.op_type for node in model.graph.node} <= {
        "Gemm", "Tanh", "Relu", "Mul", "Add", "Max", "Min"
    }  # fmt: skip


def test_same_policy_same_bytes(policy, tmp_path):
    export_onnx(policy, tmp_path / "one.onnx")
    export_onnx(policy, tmp_path / "two.onnx")
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()
