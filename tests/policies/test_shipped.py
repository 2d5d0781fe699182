"""The policies that come with flyrl do what their cards say."""

import numpy as np
import onnxruntime
import pytest

from flyrl.cli.config import training_config
from flyrl.envs.core import EnvConfig
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.policies import (
    LearnedPolicy,
    export_onnx,
    export_sb3,
    import_sb3,
    load_policy,
    named_policies,
    save_bundle,
)
from flyrl.policies.bundle import load_bundle
from flyrl.tasks import TASKS

EPISODES = 3


def test_every_task_that_can_be_learned_has_a_policy():
    learned = {load_bundle(path).env["task"]["name"] for path in named_policies().values()}
    to_be_learned = {name for name in TASKS if TASKS[name]().time_limit_s is not None}
    # of a task with two kinds of actions, one policy
    assert learned == {name for name in to_be_learned if not name.endswith("_box")}


def _as_bundle(policy, env, folder):
    save_bundle(policy.bundle, folder / "policy.safetensors")
    return load_policy(folder / "policy.safetensors").predict


def _as_sb3(policy, env, folder):
    model = export_sb3(policy.bundle)
    model.save(folder / "model.zip")
    return LearnedPolicy(import_sb3(folder / "model.zip", type(model), env, trust=True)).predict


def _as_onnx(policy, env, folder):
    export_onnx(policy.bundle, folder / "policy.onnx")
    session = onnxruntime.InferenceSession(
        folder / "policy.onnx", providers=["CPUExecutionProvider"]
    )
    return lambda observations: session.run(["action"], {"observation": observations})


@pytest.mark.parametrize("written", [_as_bundle, _as_sb3, _as_onnx])
@pytest.mark.parametrize("name", named_policies())
def test_policy_acts_the_same_in_every_format(name, written, tmp_path):
    policy = load_policy(name)
    env = EnvConfig(policy.bundle.env["task"]["name"], body=policy.bundle.env["body"])
    observations = np.random.default_rng(0).uniform(-1, 1, (50, policy.bundle.num_inputs))
    observations = observations.astype(np.float32)
    actions = written(policy, env, tmp_path)(observations)[0]
    expected, _ = policy.predict(observations)
    assert np.ptp(expected) > 0.5
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", named_policies())
def test_policy_solves_its_task_as_often_as_its_card_says_and_standing_does_not(name):
    bundle = load_bundle(named_policies()[name])
    env = training_config({**bundle.env, **bundle.training["settings"], "seed": 0}).env
    held_out = bundle.training["held_out"]
    config = EvaluationConfig(
        policies=(name,),
        controllers=("zero" if env.creature == "fly" else "relaxed",),
        task=env.resolved_task,
        terrains=(env.scene.terrain,),
        body=env.scene.body,
        physics=env.scene.physics,
        episodes=EPISODES,
        seed=held_out["seed"] + 1,
    )
    policy, zero = evaluate(config).summaries
    promised = held_out["results"][0]  # learned policies come first
    assert policy["success_rate"]["high"] >= promised["success_rate"]["low"]
    assert policy["successes"] > zero["successes"]
    assert policy["metrics"]["return"]["mean"] > zero["metrics"]["return"]["mean"]
