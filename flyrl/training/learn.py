"""Training itself: a config goes in, a run folder with a policy comes out."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import (
    CSVOutputFormat,
    Logger,
    TensorBoardOutputFormat,
)
from stable_baselines3.common.utils import LinearSchedule
from torch import nn
from tqdm import tqdm

from flyrl.envs.core import BatchedEnv
from flyrl.envs.sb3 import FlyVecEnv
from flyrl.files import replacing
from flyrl.policies import LearnedPolicy, observation_layout
from flyrl.policies.bundle import PolicyBundle, save_bundle
from flyrl.policies.export import bundle_from_sb3
from flyrl.rollouts import run_episodes
from flyrl.tasks import Episode
from flyrl.training.algorithms import AlgorithmConfig, PPOConfig, SACConfig
from flyrl.training.config import TrainingConfig, env_record
from flyrl.training.interruption import Interruption, interruption
from flyrl.training.run_folder import RunFolder

_ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}

HELD_OUT_SEEDS: Final = range(2**31, 3 * 2**30)
"""Seeds of the held-out episodes: above those that training draws, below those of evaluations."""


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes
    ----------
    folder
        Its folder.
    interrupted_by
        Number of the signal that ended it early, or None.
    """

    folder: Path
    interrupted_by: int | None


def train(config: TrainingConfig, runs: str | Path = "runs", command: Sequence[str] = ()) -> Run:
    """Train a policy.

    Parameters
    ----------
    config
        What to train, in what, how long.
    runs
        Folder in which the run folder is made.
    command
        The command that asked for it, for the record.

    Returns
    -------
    The run; its folder loads with `flyrl.load_policy`.
    """
    torch.set_num_threads(config.training.torch_threads)
    env = FlyVecEnv(config.env, config.training.num_envs, config.training.num_threads)
    model = build_model(config.algo, env, config.seed)
    env.seed(_episode_seed(config.seed))
    folder = RunFolder.create(config, Path(runs), command)
    model.set_logger(
        Logger(
            str(folder.path),
            [
                CSVOutputFormat(str(folder.path / "progress.csv")),
                TensorBoardOutputFormat(str(folder.path / "tensorboard")),
            ],
        )
    )
    with interruption() as interrupted:
        callback = _RunCallback(config, folder, interrupted)
        try:
            model.learn(
                config.training.total_decisions,
                callback=callback,
                log_interval=1 if isinstance(config.algo, PPOConfig) else 4 * env.num_envs,
            )
        finally:
            callback.close()
            model.logger.close()
            env.close()
    return Run(folder.path, interrupted.signal)


def build_model(algo: AlgorithmConfig, env: FlyVecEnv, seed: int) -> BaseAlgorithm:
    """Stable-Baselines3 model, untrained, on the CPU.

    Parameters
    ----------
    algo
        Settings.
    env
        Where it will learn.
    seed
        Of the network and the exploration.
    """
    common: dict[str, Any] = {
        "learning_rate": (
            LinearSchedule(algo.learning_rate, 0.0, 1.0)
            if algo.learning_rate_decay
            else algo.learning_rate
        ),
        "batch_size": algo.batch_size,
        "gamma": algo.gamma,
        "seed": seed,
        "device": "cpu",
    }
    network: dict[str, Any] = {
        "net_arch": list(algo.hidden_layers),
        "activation_fn": _ACTIVATIONS[algo.activation],
    }
    if isinstance(algo, PPOConfig):
        return PPO(
            "MlpPolicy",
            env,
            n_steps=algo.n_steps,
            n_epochs=algo.n_epochs,
            gae_lambda=algo.gae_lambda,
            clip_range=algo.clip_range,
            ent_coef=algo.ent_coef,
            vf_coef=algo.vf_coef,
            max_grad_norm=algo.max_grad_norm,
            policy_kwargs={**network, "log_std_init": algo.log_std_init},
            **common,
        )
    if isinstance(algo, SACConfig):
        return SAC(
            "MlpPolicy",
            env,
            buffer_size=algo.buffer_size,
            learning_starts=algo.learning_starts,
            train_freq=1,
            gradient_steps=algo.gradient_steps,
            tau=algo.tau,
            ent_coef=f"auto_{algo.initial_ent_coef}",
            policy_kwargs=network,
            **common,
        )
    raise TypeError(f"no model for {type(algo).__name__}")


def held_out_episodes(config: TrainingConfig) -> list[Episode]:
    """Episodes of the evaluation during training; no run learns from them."""
    rng = np.random.default_rng(config.training.evaluation_seed)
    seeds = rng.integers(
        HELD_OUT_SEEDS.start, HELD_OUT_SEEDS.stop, size=config.training.evaluation_episodes
    )
    task, terrain = config.env.resolved_task, config.env.scene.terrain
    return [task.sample_episode(terrain, int(seed)) for seed in seeds]


def _episode_seed(seed: int) -> int:
    """Seed of fly 0; fly i has this plus i. Far apart for neighbouring seeds of runs."""
    return int(np.random.default_rng(seed).integers(2**30))


class _RunCallback(BaseCallback):
    """Progress bar, evaluation, saving, and stopping when asked to."""

    def __init__(
        self, config: TrainingConfig, folder: RunFolder, interrupted: Interruption
    ) -> None:
        super().__init__()
        schedule = config.training
        self._config = config
        self._folder = folder
        self._interrupted = interrupted
        self._episodes = held_out_episodes(config)
        num_envs = min(schedule.num_envs, len(self._episodes))
        self._env = BatchedEnv(config.env, num_envs, schedule.num_threads)
        self._evaluations: list[dict[str, float]] = []
        self._best = (-1.0, -np.inf)
        self._next = schedule.evaluation_interval
        self._start = time.monotonic()
        self._bar = tqdm(
            total=schedule.total_decisions,
            unit=" decisions",
            disable=not schedule.progress_bar,
            # a log file gets a line now and then, a terminal a moving bar
            mininterval=0.5 if sys.stderr.isatty() else 30,
            dynamic_ncols=True,
        )

    def close(self) -> None:
        """Leave the terminal in order."""
        self._bar.close()

    def _on_step(self) -> bool:
        # set, not added up: the last update may go beyond the total
        total = self._config.training.total_decisions
        self._bar.update(min(self.num_timesteps, total) - self._bar.n)
        return not self._interrupted

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._evaluate()
            self._next = self.num_timesteps + self._config.training.evaluation_interval

    def _on_training_end(self) -> None:
        if self._interrupted:
            self._save(self._bundle())
        else:
            self._evaluate()
            self.logger.dump(self.num_timesteps)
        self._folder.write_json(
            "status.json",
            {
                "decisions": self.num_timesteps,
                "wall_time_s": round(time.monotonic() - self._start, 3),
                "interrupted_by": self._interrupted.signal and self._interrupted.signal.name,
            },
        )

    def _bundle(self, evaluation: dict[str, float] | None = None) -> PolicyBundle:
        return bundle_from_sb3(
            self.model,
            observation_layout(self._config.env.resolved_task),
            env_record(self._config.env),
            {
                "algo": self._config.algo.name,
                "seed": self._config.seed,
                "decisions": self.num_timesteps,
                "evaluation": evaluation,
            },
        )

    def _save(self, bundle: PolicyBundle) -> None:
        save_bundle(bundle, self._folder.last)
        with replacing(self._folder.model) as partial:
            self.model.save(partial)

    def _evaluate(self) -> None:
        """Let the policy, as it would be saved, walk the held-out episodes; keep it if best."""
        records = run_episodes(self._env, LearnedPolicy(self._bundle()), self._episodes)
        evaluation = {
            "decisions": self.num_timesteps,
            "success_rate": float(np.mean([record.success for record in records])),
            "mean_return": float(np.mean([record.return_ for record in records])),
            "mean_duration_s": float(np.mean([record.duration_s for record in records])),
        }
        self._evaluations.append(evaluation)
        self._folder.write_rows("evaluations.csv", self._evaluations)
        for key in ("success_rate", "mean_return", "mean_duration_s"):
            self.logger.record(f"evaluation/{key}", evaluation[key])
        bundle = self._bundle(evaluation)
        self._save(bundle)
        score = (evaluation["success_rate"], evaluation["mean_return"])
        if score > self._best:
            self._best = score
            save_bundle(bundle, self._folder.best)
        self._bar.set_postfix(success=f"{evaluation['success_rate']:.0%}")
