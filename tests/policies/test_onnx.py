"""ONNX files act as the policy, in ONNX Runtime."""

import json
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest

from flyrl.policies import LearnedPolicy, TermLayout, export_onnx
from flyrl.policies.networks import Normaliser
from tests.policies.conftest import random_network

LAYOUT = (TermLayout("all", 40),)


@pytest.fixture(params=[("tanh", "clip"), ("relu", "clip"), ("tanh", "tanh"), ("relu", "tanh")])
def policy(request, bundle):
    """As large as a trained one, with outputs that reach the bounds."""
    activation, squashing = request.param
    return replace(
        bundle,
        **random_network((40, 64, 64, 2), activation),
        squashing=squashing,
        observation=LAYOUT,
        action_low=(-0.5, -1.0),
        action_high=(1.5, 0.5),
    )


@pytest.fixture
def path(tmp_path):
    return tmp_path / "policy.onnx"


def _run(path, observations):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(["action"], {"observation": observations})[0]


def _check(bundle, path, observations):
    """Assert that the file gives the policy's actions; return those."""
    export_onnx(bundle, path)
    actions = _run(path, observations)
    expected, _ = LearnedPolicy(bundle).predict(observations)
    assert actions.dtype == expected.dtype
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)
    return actions


def test_same_actions_of_one_and_of_many_that_stay_inside_their_bounds(policy, path):
    observations = np.random.default_rng(1).normal(size=(500, 40)).astype(np.float32)
    assert np.ptp(_check(policy, path, observations)) > 1
    _check(policy, path, observations[:1])
    extreme = _run(path, 1e6 * observations)
    assert (extreme >= np.float32(policy.action_low)).all()
    assert (extreme <= np.float32(policy.action_high)).all()


def test_same_whole_numbers(bundle, path):
    bundle = replace(
        bundle,
        **random_network((40, 64, 15)),
        squashing="argmax",
        observation=LAYOUT,
        action_low=(0.0, -2.0, 4.0),
        action_high=(9.0, 1.0, 4.0),
    )
    observations = np.random.default_rng(1).normal(size=(500, 40)).astype(np.float32)
    actions = _check(bundle, path, observations)
    assert [len(np.unique(column)) for column in actions.T] == [10, 4, 1]


def test_the_first_of_equals_is_taken(choosing, path):
    export_onnx(choosing, path)
    # outputs [0.5, 0.5, 0] and [1, 0], then [0.5, 0.5, 1] and [1, 1]
    actions = _run(path, np.array([[0.5, -0.5, 0.0], [0.5, 0.0, 0.0]], np.float32))
    np.testing.assert_array_equal(actions, [[0, -1], [2, -1]])


# a narrow spread far from zero is normalised as precisely
@pytest.mark.parametrize(("variance", "epsilon", "clip"), [(1.0, 1e-8, 1.5), (1e-8, 1e-12, 10.0)])
def test_observations_are_normalised_as_by_the_policy(policy, path, variance, epsilon, clip):
    rng = np.random.default_rng(2)
    mean, variances = rng.normal(size=40), variance * rng.uniform(0.1, 4, 40)
    policy = replace(policy, normaliser=Normaliser(mean, variances, epsilon, clip))
    observations = mean + rng.normal(scale=variance**0.5, size=(200, 40))
    assert np.ptp(_check(policy, path, observations.astype(np.float32))) > 1


@pytest.mark.parametrize("is_choosing", [False, True])
def test_a_memory_goes_from_step_to_step_as_the_policy_s(recurrent, path, is_choosing):
    changes = {"squashing": "argmax", "action_low": (0.0, 0.0), "action_high": (7.0, 3.0)}
    network = random_network((3, 16, 12 if is_choosing else 2), lstm_sizes=(3, 3, 3))
    recurrent = replace(recurrent, **network, **(changes if is_choosing else {}))
    export_onnx(recurrent, path)
    rng = np.random.default_rng(1)
    steps, starts = rng.normal(size=(30, 5, 3)).astype(np.float32), rng.random((30, 5)) < 0.2
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    policy, state, given = LearnedPolicy(recurrent), None, []
    memory = [np.zeros((2, 5, 3), np.float32)] * 2
    for observation, start in zip(steps, starts, strict=True):
        feed = {"observation": observation, "episode_start": start}
        action, *memory = session.run(None, feed | {"hidden": memory[0], "cell": memory[1]})
        expected, state = policy.predict(observation, state, start)
        np.testing.assert_allclose(action, expected, rtol=0, atol=1e-5)
        np.testing.assert_allclose(memory, state, rtol=0, atol=1e-5)
        given.append(action)
    assert np.abs(state).max() > 0.5
    assert np.ptp(given, axis=(0, 1)).all()


def test_file_says_what_it_is(bundle, path):
    export_onnx(bundle, path)
    record = {prop.key: json.loads(prop.value) for prop in onnx.load(path).metadata_props}
    assert record == {
        "flyrl.observation": [{"name": "bearing", "size": 2}, {"name": "speed", "size": 1}],
        "flyrl.action": {"low": [-1, -1], "high": [1, 1]},
        "flyrl.env": {"task": "target"},
        "flyrl.training": {"decisions": 7},
    }


def test_file_holds_standard_operators_only_and_the_same_bytes_each_time(policy, path):
    export_onnx(policy, path)
    first, model = path.read_bytes(), onnx.load(path)
    assert {node.domain for node in model.graph.node} == {""}
    assert not model.functions
    assert {node.op_type for node in model.graph.node} <= {
        "Gemm", "Tanh", "Relu", "Mul", "Add", "Max", "Min"
    }  # fmt: skip
    export_onnx(policy, path)
    assert path.read_bytes() == first
