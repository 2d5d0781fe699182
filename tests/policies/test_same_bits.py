"""A policy gives the same actions to the bit, in single and in batched environments."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, observation_layout
from flyrl.tasks import TASKS
from tests.policies.conftest import random_network


def _walk(env, policy, seed):
    observation, _ = env.reset(seed=seed)
    actions = []
    for _ in range(10):
        action, _ = policy.predict(observation)
        actions.append(action)
        observation, *_ = env.step(action)
    env.close()
    return np.array(actions)


@pytest.mark.parametrize(
    ("task", "env_id", "squashing"),
    [("target", "Target-v0", "tanh"), ("target_goal", "TargetGoal-v0", "clip")],
)
def test_in_single_and_batched_environments(task, env_id, squashing, bundle):
    layout = observation_layout(TASKS[task]())
    # as large as a trained one
    network = random_network((sum(term.size for term in layout), 64, 64, 2), "tanh")
    bundle = replace(bundle, **network, squashing=squashing, observation=layout)
    policy, env_id = LearnedPolicy(bundle), f"flyrl:flyrl/{env_id}"
    together = _walk(gymnasium.make_vec(env_id, num_envs=3), policy, seed=4)
    assert np.ptp(together) > 0.5
    for i in range(3):
        alone = _walk(gymnasium.make(env_id), policy, seed=4 + i)
        assert alone.tobytes() == np.ascontiguousarray(together[:, i]).tobytes()
