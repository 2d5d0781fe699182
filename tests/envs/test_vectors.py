"""Dict observations as vectors: the order of `gymnasium.spaces.flatten`."""

import gymnasium
import numpy as np
import pytest

import flyrl  # noqa: F401  (registers the ids)
from flyrl.envs.config import EnvConfig
from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import EvaluationConfig
from flyrl.policies.bundle import observation_layout
from flyrl.policies.networks import vectors
from flyrl.tasks import TASKS
from flyrl.training.config import TrainingConfig

HYBRID = {"name": "hybrid_turning", "time_limit": 0.2}


def test_a_dict_becomes_the_vector_that_gymnasium_makes_of_it():
    env = gymnasium.make("flyrl/HybridTurning-v0", physics="fast")
    observation, _ = env.reset(seed=3)
    flat = BatchedEnv(EnvConfig("hybrid_turning", physics="fast", as_vectors=True), 2, 1)
    rows = flat.reset(seeds=[3, 4])
    expected = gymnasium.spaces.flatten(env.observation_space, observation)
    np.testing.assert_array_equal(rows[0], expected)
    assert flat.task.slices()["joints"] == slice(141, 267)  # the last of 267 values


def test_a_policy_takes_the_dict_of_one_fly_and_of_many():
    layout = {term.name: term.size for term in observation_layout(TASKS["hybrid_turning"]())}
    env = BatchedEnv(EnvConfig("hybrid_turning", physics="fast"), 3, 1)
    flat = BatchedEnv(EnvConfig("hybrid_turning", physics="fast", as_vectors=True), 3, 1)
    many, expected = env.reset(seeds=[0, 1, 2]), flat.reset(seeds=[0, 1, 2])
    np.testing.assert_array_equal(vectors(many, layout), expected)
    for i in range(3):
        one = {name: values[i] for name, values in many.items()}
        np.testing.assert_array_equal(vectors(one, layout), expected[i])
        alone = {name: values[i : i + 1] for name, values in many.items()}
        np.testing.assert_array_equal(vectors(alone, layout), expected[i : i + 1])


@pytest.mark.parametrize("of", ["training", "evaluation"])
def test_training_and_evaluation_take_vectors(of):
    env = (
        TrainingConfig(env=EnvConfig(HYBRID)).env
        if of == "training"
        else EvaluationConfig(task=HYBRID).env("flat")
    )
    assert env.resolved_task.is_flat
    assert env.resolved_task.name == "hybrid_turning"
    assert env.resolved_task.time_limit_s == 0.2


def test_a_task_with_vectors_stays_as_it_is():
    for name in ("target", "target_goal"):
        assert TASKS[name]().flattened() is TASKS[name]()
