"""RL Zoo's command lines, given the id and the name of the package and nothing else."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO

from flyrl.envs.core import EnvConfig
from flyrl.policies import LearnedPolicy, import_sb3

SETTINGS = """
flyrl/Target-v0:
  n_timesteps: !!float 64
  policy: MlpPolicy
  n_envs: 2
  n_steps: 16
  batch_size: 32
  n_epochs: 2
"""
COMMON = "--algo ppo --env flyrl/Target-v0 --gym-packages flyrl -f logs --device cpu"
TRAIN = f"train {COMMON} --conf-file ppo.yml --eval-freq -1 --seed 0"
ENJOY = f"enjoy {COMMON} -n 150 --no-render"
BOTH = f"""
import sys
from rl_zoo3.enjoy import enjoy
from rl_zoo3.train import train

for command, run in (("{TRAIN}", train), ("{ENJOY}", enjoy)):
    sys.argv = command.split()
    run()
"""
"""In one process, since it takes seconds to import."""


@pytest.mark.slow
def test_train_learns_enjoy_walks_an_episode_and_the_policy_can_be_imported(tmp_path):
    (tmp_path / "ppo.yml").write_text(SETTINGS)
    done = subprocess.run(
        [sys.executable, "-c", BOTH],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=True,
    )
    file = Path("logs", "ppo", "flyrl-Target-v0_1", "flyrl-Target-v0.zip")
    assert str(file) in done.stdout
    assert re.search(r"^1 Episodes\nMean reward: -?\d+\.\d+", done.stdout, re.MULTILINE)
    model = PPO.load(tmp_path / file, device="cpu")
    assert model.num_timesteps == 64
    policy = LearnedPolicy(import_sb3(tmp_path / file, PPO, EnvConfig(), trust=True))
    observations = np.random.default_rng(0).normal(size=(20, 47)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(policy.predict(observations)[0], expected, rtol=0, atol=1e-6)
