"""The policies that come with flyrl do what their cards say."""

import pytest

from flyrl.cli.config import training_config
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.policies import named_policies
from flyrl.policies.bundle import load_bundle
from flyrl.tasks import TASK_NAMES, task_named

EPISODES = 3


def test_every_task_that_can_be_learned_has_a_policy():
    learned = {load_bundle(path).env["task"]["name"] for path in named_policies().values()}
    to_be_learned = {name for name in TASK_NAMES if task_named(name).time_limit_s is not None}
    # of a task with two kinds of actions, one policy
    assert learned == {name for name in to_be_learned if not name.endswith("_box")}


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
    policy, zero = evaluate(config).summary
    promised = held_out["results"][0]  # learned policies come first
    assert policy["success_rate"]["high"] >= promised["success_rate"]["low"]
    assert policy["successes"] > zero["successes"]
    assert policy["metrics"]["return"]["mean"] > zero["metrics"]["return"]["mean"]
