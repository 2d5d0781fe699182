"""Other libraries on the environments, given the id and nothing else."""

import functools
import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from flyrl.tasks import TASKS
from tests.clients.usual import ID, LIMIT, SETTINGS, make, make_vec

SIZE = sum(term.size for term in TASKS["target"]().observation)

pytestmark = pytest.mark.filterwarnings("ignore")


def test_minari_makes_a_dataset_of_episodes_that_knows_its_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    import minari

    env = make()
    collector = minari.DataCollector(env, record_infos=True)
    for seed in range(2):
        collector.reset(seed=seed)
        env.action_space.seed(seed)
        ends = False
        while not ends:
            _, _, terminated, truncated, _ = collector.step(env.action_space.sample())
            ends = terminated or truncated
    dataset = collector.create_dataset("flyrl/random-v0")
    episodes = list(dataset.iterate_episodes())
    assert [len(episode.rewards) for episode in episodes] == [LIMIT, LIMIT]
    assert set(episodes[0].infos) == {"is_success", "outcome", "time_s"}
    observation, _ = dataset.recover_environment().reset(seed=1)
    assert (observation == episodes[1].observations[0]).all()


SBX = f"""
import numpy as np
from jax import tree_util
from sbx import SAC

model = SAC("MlpPolicy", {ID!r}, learning_starts=8, seed=0)
before = model.policy.actor_state.params
model.learn(12)
pairs = zip(*map(tree_util.tree_leaves, (before, model.policy.actor_state.params)), strict=True)
assert any(not np.array_equal(one, other) for one, other in pairs)
action, _ = model.predict(model.get_env().reset())
assert action.shape == (1, 2)
"""


@pytest.mark.slow  # JAX compiles
def test_sbx_learns_and_decides():
    """In a process of its own: one that has imported JAX warns of every fork from then on."""
    # its compiler is to be quick, not what it makes
    quick = {**os.environ, "XLA_FLAGS": "--xla_backend_optimization_level=0"}
    subprocess.run([sys.executable, "-c", SBX], env=quick, check=True)


def test_a_batch_that_skrl_wraps_walks_as_the_batch_itself():
    from skrl.envs.wrappers.torch import wrap_env

    plain, wrapped = make_vec(num_envs=2), wrap_env(make_vec(num_envs=2))
    first, _ = wrapped.reset()  # with a seed of its own
    core = wrapped.unwrapped.core
    np.testing.assert_array_equal(first.numpy(), plain.core.reset(episodes=core.episodes))
    ours, theirs = wrapped.step(torch.ones(2, 2)), plain.step(np.ones((2, 2), np.float32))
    np.testing.assert_array_equal(ours[0].numpy(), theirs[0])
    np.testing.assert_allclose(ours[1].numpy()[:, 0], theirs[1], rtol=1e-6)


def _seeded(seed):
    env = make()
    env.action_space.seed(seed)
    return env


@pytest.mark.slow  # to import Tianshou takes seconds
def test_tianshous_collector_walks_two_flies_in_processes():
    from tianshou.data import Collector, VectorReplayBuffer
    from tianshou.env import SubprocVectorEnv
    from tianshou.policy import RandomPolicy

    envs = SubprocVectorEnv([functools.partial(_seeded, seed) for seed in range(2)])
    envs.seed(0)
    collector = Collector(RandomPolicy(), envs, VectorReplayBuffer(128, 2))
    result = collector.collect(n_step=2 * LIMIT, random=True)
    batch = collector.buffer.sample(0)[0]
    envs.close()
    assert (result["n/st"], result["lens"].tolist()) == (2 * LIMIT, [LIMIT, LIMIT])
    assert np.isfinite(batch.obs).all()
    assert batch.truncated.sum() == 2


@pytest.mark.slow  # to import TorchRL takes seconds
@pytest.mark.parametrize("flies", [1, 2])
def test_torchrls_rollouts(flies):
    from torchrl.envs import GymEnv

    env = GymEnv(ID, **({"num_envs": flies} if flies > 1 else {}), **SETTINGS)
    env.set_seed(0)
    torch.manual_seed(0)  # which the drives of a rollout are drawn with
    rollout = env.rollout(LIMIT, break_when_any_done=False)
    env.close()
    steps = rollout["next"].reshape(flies, LIMIT)
    assert steps["observation"].shape == (flies, LIMIT, SIZE)
    assert steps["truncated"].sum(dim=1).flatten().tolist() == [1] * flies
    assert flies > 1 or steps["truncated"][0, -1]
