import dataclasses
import itertools

import numpy as np
import pytest

from flyrl.envs.core import EnvConfig
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.evaluation.conditions import QUANTITIES, Condition, compared_conditions, value_text
from flyrl.tasks import TASKS

SHORT = dataclasses.replace(TASKS["target"](), time_limit_s=0.2)
STRONG = {
    "drive_latency": 0.05,
    "missing_legs": ("LM",),
    "fixed_joints": (("joint_LMTibia", 1.2),),
    "senses_contact": False,
}


def usual_env(name):
    return EnvConfig(body="fly_muscles" if name.endswith("_muscles") else "current")


@pytest.mark.parametrize("name", QUANTITIES)
def test_the_usual_value_changes_nothing_and_another_makes_another_fly(name):
    env = usual_env(name)
    same = Condition(name, QUANTITIES[name].usual).env(env)
    assert same.scene == dataclasses.replace(env.scene, queue_places=same.scene.queue_places)
    drawn = env.sample_episode(3).randomisation
    assert same.sample_episode(3).randomisation == drawn
    other = Condition(name, STRONG.get(name, 0.5)).env(env)
    has_changed = other.scene != env.scene or other.sample_episode(3).randomisation != drawn
    assert has_changed == (name != "push")  # which is of the episode


def test_a_push_comes_from_either_side():
    episodes = [EnvConfig().sample_episode(seed) for seed in (4, 5)]
    pushed = [Condition("push", 6.0).episode(episode).pushes for episode in episodes]
    assert pushed == [(1.0, -6.0), (1.0, 6.0)]


def test_values_in_short():
    values = (0.5, True, (), ("LF", "RM"), (("joint_LFTibia", 1.2),))
    texts = ["0.5", "true", "none", "LF+RM", "joint_LFTibia+1.2"]
    assert [*map(value_text, values)] == texts


def test_everyone_walks_under_every_condition_from_the_same_place():
    settings = {"task": SHORT, "physics": "fast", "episodes": 3, "num_threads": 1}
    vary = {"missing_legs": ((), ("LM", "RM")), "friction": (0.1,)}
    results = evaluate(EvaluationConfig(controllers=("hybrid", "zero"), vary=vary, **settings))
    labels = ["missing_legs=none", "missing_legs=LM+RM", "friction=0.1"]
    columns = results.episodes[["condition", "controller", "episode"]]
    walked = list(columns.itertuples(index=False, name=None))
    places = list(itertools.product(labels, ("hybrid", "zero")))
    assert walked == [(*place, episode) for place in places for episode in range(3)]
    assert [(row["condition"], row["controller"]) for row in results.summaries] == places
    starts = np.reshape([path.position_w[0] for path in results.trajectories.values()], (6, 3, 3))
    np.testing.assert_allclose(starts, np.broadcast_to(starts[0], starts.shape), atol=1e-6)
    # a condition without a change is the usual walk
    usual = evaluate(EvaluationConfig(controllers=("hybrid",), **settings))
    own = results.episodes[results.episodes["controller"] == "hybrid"]
    ways = list(own["displacement_mm"])
    assert ways[:3] == list(usual.episodes["displacement_mm"])
    assert not np.isin(ways[3:], ways[:3]).any()


@pytest.mark.parametrize(
    ("vary", "labels"),
    [
        ({}, [""]),
        ({"friction": (0.5, 1, 2)}, ["friction=1", "friction=0.5", "friction=2"]),
        ({"missing_legs": ((), ("LF",)), "push": (0, 8)},
         ["missing_legs=none", "missing_legs=LF", "push=8"]),
        ({"push": (4, 8)}, ["push=4", "push=8"]),
    ],
)  # fmt: skip
def test_the_usual_condition_comes_first_and_once(vary, labels):
    assert [condition.label for condition in compared_conditions(vary)] == labels
