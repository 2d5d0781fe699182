"""TorchRL's environments, given the id and nothing else."""

import pytest
import torch

from flyrl.tasks import TASKS

ID = "flyrl:flyrl/Target-v0"
SETTINGS = {"decision_interval": 0.1, "physics": "fast"}
LIMIT = 30  # decisions
SIZE = sum(term.size for term in TASKS["target"]().observation)

pytestmark = pytest.mark.slow  # to import TorchRL takes seconds


@pytest.mark.filterwarnings("ignore")
def test_a_rollout_of_one_fly():
    from torchrl.envs import GymEnv

    env = GymEnv(ID, **SETTINGS)
    env.set_seed(0)
    torch.manual_seed(0)  # which the drives of a rollout are drawn with
    rollout = env.rollout(LIMIT + 1)
    env.close()
    assert rollout["next", "observation"].shape == (LIMIT, SIZE)
    assert rollout["next", "truncated"].squeeze().tolist() == [False] * (LIMIT - 1) + [True]


@pytest.mark.filterwarnings("ignore")
def test_a_rollout_of_two_flies():
    from torchrl.envs import GymEnv

    env = GymEnv(ID, num_envs=2, **SETTINGS)
    env.set_seed(0)
    torch.manual_seed(0)
    rollout = env.rollout(LIMIT, break_when_any_done=False)
    env.close()
    assert rollout["next", "observation"].shape == (2, LIMIT, SIZE)
    assert rollout["next", "truncated"].sum(dim=1).flatten().tolist() == [1, 1]
