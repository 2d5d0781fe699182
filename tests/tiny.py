"""Trainings of seconds: the coarse physics, and episodes of ten decisions."""

from dataclasses import replace

from flyrl.envs.core import EnvConfig
from flyrl.tasks import TASKS
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig

TINY_ENV = EnvConfig(replace(TASKS["target"](), time_limit_s=0.2), physics="fast")
TINY = TrainingConfig(
    env=TINY_ENV,
    algo=AlgorithmConfig("ppo", n_steps=8, batch_size=16, n_epochs=2, hidden_layers=(8,)),
    training=ScheduleConfig(
        total_timesteps=64,
        num_envs=4,
        num_threads=1,
        evaluation_interval=32,
        evaluation_episodes=2,
        checkpoint_interval=32,
        progress_bar=False,
    ),
)

TINY_ARGUMENTS = (
    "physics=fast",
    "task.time_limit=0.2",
    "training.total_timesteps=64",
    "training.num_envs=4",
    "training.num_threads=1",
    "training.evaluation_interval=32",
    "training.evaluation_episodes=2",
    "training.checkpoint_interval=32",
    "training.progress_bar=false",
    "algo.n_steps=8",
    "algo.batch_size=16",
    "algo.n_epochs=2",
    "algo.hidden_layers=[8]",
)
"""The same from the command line."""
