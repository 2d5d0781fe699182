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

ROOT = Path(__file__).parents[2]
SETTINGS = """
flyrl/Target-v0:
  n_timesteps: !!float 64
  policy: MlpPolicy
  n_envs: 2
  n_steps: 16
  batch_size: 32
  n_epochs: 2
"""

pytestmark = pytest.mark.slow


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


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Folder in which RL Zoo trained and played, and what it printed."""
    folder = tmp_path_factory.mktemp("zoo")
    (folder / "ppo.yml").write_text(SETTINGS)
    done = subprocess.run(
        [sys.executable, "-c", BOTH],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    return folder, done.stdout


@pytest.fixture(scope="module")
def model_file(trained):
    return trained[0] / "logs" / "ppo" / "flyrl-Target-v0_1" / "flyrl-Target-v0.zip"


def test_train_leaves_a_model_that_learned(model_file):
    assert PPO.load(model_file, device="cpu").num_timesteps == 64


def test_enjoy_walks_an_episode(trained, model_file):
    folder, output = trained
    assert str(model_file.relative_to(folder)) in output
    assert re.search(r"^1 Episodes\nMean reward: -?\d+\.\d+", output, re.MULTILINE)


def test_what_rl_zoo_trained_can_be_imported(model_file):
    policy = LearnedPolicy(import_sb3(model_file, PPO, EnvConfig(), trust=True))
    observations = np.random.default_rng(0).normal(size=(20, 46)).astype(np.float32)
    expected, _ = PPO.load(model_file, device="cpu").predict(observations, deterministic=True)
    np.testing.assert_allclose(policy.predict(observations)[0], expected, rtol=0, atol=1e-6)
