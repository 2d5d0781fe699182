"""Trainings of seconds: the coarse physics, and episodes of ten decisions."""

from dataclasses import replace

from flyrl.envs.core import EnvConfig
from flyrl.tasks import TASKS
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig

TINY_ENV = EnvConfig(replace(TASKS["target"](), time_limit_s=0.2), physics="fast")
SCHEDULE = {
    "total_timesteps": 64,
    "num_envs": 4,
    "num_threads": 1,
    "evaluation_interval": 32,
    "evaluation_episodes": 2,
    "checkpoint_interval": 32,
    "progress_bar": False,
}
ALGO = {"n_steps": 8, "batch_size": 16, "n_epochs": 2, "hidden_layers": [8]}
TINY = TrainingConfig(
    env=TINY_ENV, algo=AlgorithmConfig("ppo", **ALGO), training=ScheduleConfig(**SCHEDULE)
)
TINY_ARGUMENTS = (
    *("physics=fast", "task.time_limit=0.2"),
    *(f"training.{key}={value}" for key, value in SCHEDULE.items()),
    *(f"algo.{key}={value}" for key, value in ALGO.items()),
)
"""The same from the command line."""
