import json
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from flyrl.policies import LearnedPolicy, TermLayout, export_onnx
from flyrl.policies.networks import Normaliser
from flyrl.policies.sb3 import bundle_from_sb3
from flyrl.training.algorithms import ALGORITHMS, AlgorithmConfig
from flyrl.training.models import build_model
from tests.policies.conftest import Bandit, perturbed, random_network


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


def test_onnxruntime_gives_the_same_whole_numbers(bundle, tmp_path):
    bundle = replace(
        bundle,
        network=random_network((40, 64, 15), "tanh"),
        squashing="argmax",
        observation=(TermLayout("all", 40),),
        action_low=(0.0, -2.0, 4.0),
        action_high=(9.0, 1.0, 4.0),
    )
    export_onnx(bundle, tmp_path / "policy.onnx")
    observations = np.random.default_rng(1).normal(size=(500, 40)).astype(np.float32)
    actions = _run(tmp_path / "policy.onnx", observations)
    expected, _ = LearnedPolicy(bundle).predict(observations)
    assert [len(np.unique(column)) for column in expected.T] == [10, 4, 1]
    assert actions.dtype == np.int64
    np.testing.assert_array_equal(actions, expected)


def test_onnxruntime_takes_the_first_of_equals(choosing, tmp_path):
    export_onnx(choosing, tmp_path / "policy.onnx")
    # outputs [0.5, 0.5, 0] and [1, 0], then [0.5, 0.5, 1] and [1, 1]
    observations = np.array([[0.5, -0.5, 0.0], [0.5, 0.0, 0.0]], np.float32)
    actions = _run(tmp_path / "policy.onnx", observations)
    np.testing.assert_array_equal(actions, [[0, -1], [2, -1]])


def test_a_memory_chooses_whole_numbers_as_the_policy_does(recurrent, tmp_path):
    network = random_network((3, 16, 12), "tanh")
    bounds = {"action_low": (0.0, 0.0), "action_high": (7.0, 3.0)}
    recurrent = replace(recurrent, network=network, squashing="argmax", **bounds)
    export_onnx(recurrent, tmp_path / "policy.onnx")
    rng = np.random.default_rng(1)
    steps, starts = rng.normal(size=(20, 5, 3)).astype(np.float32), rng.random((20, 5)) < 0.2
    policy, state, given = LearnedPolicy(recurrent), None, []
    zeros = [np.zeros((2, 5, 3), np.float32)] * 2
    for i, (action, _) in enumerate(_walk(tmp_path / "policy.onnx", steps, starts, zeros)):
        expected, state = policy.predict(steps[i], state, starts[i])
        np.testing.assert_array_equal(action, expected)
        given.append(action)
    assert np.ptp(given, axis=(0, 1)).all()


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


def test_a_narrow_spread_far_from_zero_is_normalised_as_precisely(policy, tmp_path):
    rng = np.random.default_rng(2)
    policy = replace(policy, normaliser=Normaliser(rng.normal(size=40), [1e-8] * 40, 1e-12, 10.0))
    export_onnx(policy, tmp_path / "policy.onnx")
    spread = rng.normal(scale=1e-4, size=(200, 40))
    observations = (policy.normaliser.mean + spread).astype(np.float32)
    expected, _ = LearnedPolicy(policy).predict(observations)
    assert np.ptp(expected) > 1
    actions = _run(tmp_path / "policy.onnx", observations)
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)


def _walk(path, steps, starts, state):
    """Actions and memory, step by step; `steps` is (t, n, k), `starts` (t, n)."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    for observation, start in zip(steps, starts, strict=True):
        given = {"observation": observation}
        if state:
            given |= {"hidden": state[0], "cell": state[1], "episode_start": start}
        action, *state = session.run(None, given)
        yield action, state


def test_a_memory_goes_from_step_to_step_as_the_policy_s(recurrent, tmp_path):
    export_onnx(recurrent, tmp_path / "policy.onnx")
    rng = np.random.default_rng(1)
    steps, starts = rng.normal(size=(30, 5, 3)).astype(np.float32), rng.random((30, 5)) < 0.2
    policy, state = LearnedPolicy(recurrent), None
    zeros = [np.zeros((2, 5, 3), np.float32)] * 2
    for i, (action, memory) in enumerate(_walk(tmp_path / "policy.onnx", steps, starts, zeros)):
        expected, state = policy.predict(steps[i], state, starts[i])
        np.testing.assert_allclose(action, expected, rtol=0, atol=1e-5)
        np.testing.assert_allclose(memory, state, rtol=0, atol=1e-5)
    assert np.abs(state).max() > 0.5


@pytest.mark.parametrize("name", ALGORITHMS)
def test_same_actions_as_the_model_that_was_trained(name, tmp_path):
    """From torch, over the bundle, to ONNX."""
    algo = AlgorithmConfig(name, hidden_layers=(32, 32), normalize_observation=True)
    env = DummyVecEnv(8 * [Bandit])
    model = perturbed(build_model(algo, env, seed=0))
    statistics, rng = model.get_vec_normalize_env(), np.random.default_rng(1)
    statistics.obs_rms.mean = rng.normal(size=40)
    statistics.obs_rms.var = rng.uniform(0.1, 4, size=40)
    export_onnx(bundle_from_sb3(model, (TermLayout("all", 40),), {}, {}), tmp_path / "policy.onnx")
    steps, starts = rng.normal(size=(20, 10, 40)).astype(np.float32), rng.random((20, 10)) < 0.2
    lstm = getattr(model.policy, "lstm_actor", None)
    zeros = lstm and [np.zeros((lstm.num_layers, 10, lstm.hidden_size), np.float32)] * 2
    state, given = None, []
    for i, (action, _) in enumerate(_walk(tmp_path / "policy.onnx", steps, starts, zeros)):
        seen = statistics.normalize_obs(steps[i])
        expected, state = model.predict(seen, state, starts[i], deterministic=True)
        np.testing.assert_allclose(action, expected, rtol=0, atol=1e-5)
        given.append(expected)
    assert np.ptp(given) > 0.5


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
