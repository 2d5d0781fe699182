"""Tianshou's collector, in processes of its own, given the id and nothing else."""

import functools

import gymnasium
import numpy as np
import pytest

pytestmark = pytest.mark.slow  # to import Tianshou takes seconds


def _make(seed):
    env = gymnasium.make("flyrl:flyrl/Target-v0", physics="fast", decision_interval=0.1)
    env.action_space.seed(seed)
    return env


@pytest.mark.filterwarnings("ignore")
def test_a_collector_walks_two_flies_in_processes():
    from tianshou.data import Collector, VectorReplayBuffer
    from tianshou.env import SubprocVectorEnv
    from tianshou.policy import RandomPolicy

    envs = SubprocVectorEnv([functools.partial(_make, seed) for seed in range(2)])
    envs.seed(0)
    collector = Collector(RandomPolicy(), envs, VectorReplayBuffer(128, 2))
    result = collector.collect(n_step=60, random=True)
    batch = collector.buffer.sample(0)[0]
    envs.close()
    assert (result["n/st"], result["lens"].tolist()) == (60, [30, 30])
    assert np.isfinite(batch.obs).all()
    assert batch.truncated.sum() == 2
