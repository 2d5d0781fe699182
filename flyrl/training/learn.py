"""Training itself: a config goes in, a run folder with a policy comes out."""

import sys
import time
from collections.abc import Mapping, Sequence
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
from torch.utils.tensorboard import SummaryWriter
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
from flyrl.training.checkpoint import (
    learner_state,
    load_checkpoint,
    restore_learner,
    save_checkpoint,
)
from flyrl.training.config import TrainingConfig, env_record
from flyrl.training.interruption import Interruption, interruption
from flyrl.training.run_folder import RunFolder, read_rows

_DECISIONS_LOGGED: Final = "time/total_timesteps"

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
    model = _prepare(config)
    return _learn(config, model, RunFolder.create(config, Path(runs), command), None)


def resume(config: TrainingConfig, folder: str | Path, command: Sequence[str] = ()) -> Run:
    """Go on with an interrupted run, from its latest checkpoint, to the end.

    On the same machine and versions, it ends with the policy that it would have had without the
    interruption, to the bit.

    Parameters
    ----------
    config
        As the run was started with.
    folder
        Its folder.
    command
        The command that asked for it, for the record.

    Raises
    ------
    ResumeError
        There is no run in the folder, it has other settings, it is finished, or there is no
        checkpoint, or a damaged one.
    OSError
        The folder cannot be written to; the latest checkpoint stays as it is.
    """
    run_folder = RunFolder.open(config, Path(folder), command)
    state = load_checkpoint(run_folder.latest_checkpoint())
    model = _prepare(config)
    return _learn(config, model, run_folder, state)


def _prepare(config: TrainingConfig) -> BaseAlgorithm:
    torch.set_num_threads(config.training.torch_threads)
    env = FlyVecEnv(config.env, config.training.num_envs, config.training.num_threads)
    model = build_model(config.algo, env, config.seed)
    env.seed(_episode_seed(config.seed))
    return model


def _learn(
    config: TrainingConfig, model: BaseAlgorithm, folder: RunFolder, state: dict[str, Any] | None
) -> Run:
    """Learn until the end or an interruption; from a checkpoint's state, if there is one."""
    total = config.training.total_decisions
    model.set_logger(_logger(folder, None if state is None else state["run"]["decisions"]))
    env = _env_of(model)
    with interruption() as interrupted:
        callback = _RunCallback(config, folder, interrupted)
        if state is not None:
            env.restore(state["env"])
            restore_learner(model, state["learner"])
            callback.restore(state["run"])
            total -= model.num_timesteps
        try:
            model.learn(
                total,
                callback=callback,
                log_interval=1 if isinstance(config.algo, PPOConfig) else 4 * env.num_envs,
                reset_num_timesteps=state is None,
            )
        finally:
            callback.close()
            model.logger.close()
            env.close()
    return Run(folder.path, interrupted.signal)


def _logger(folder: RunFolder, decisions: int | None) -> Logger:
    """Metrics as CSV and for TensorBoard; those logged after `decisions` are dropped."""
    tensorboard = TensorBoardOutputFormat(str(folder.path / "tensorboard"))
    table = folder.path / "progress.csv"
    rows: list[dict[str, str]] = []
    if decisions is not None:
        tensorboard.writer.close()
        tensorboard.writer = SummaryWriter(folder.path / "tensorboard", purge_step=decisions + 1)
        rows = [row for row in read_rows(table) if int(row[_DECISIONS_LOGGED]) <= decisions]
    csv_format = CSVOutputFormat(str(table))
    for row in rows:
        csv_format.write({key: _number(text) for key, text in row.items() if text}, {})
    return Logger(str(folder.path), [csv_format, tensorboard])


def _number(text: str) -> float:
    return int(text) if text.isdigit() else float(text)


def _env_of(model: BaseAlgorithm) -> FlyVecEnv:
    assert isinstance(model.env, FlyVecEnv)
    return model.env


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
        self._next_evaluation = schedule.evaluation_interval
        self._next_checkpoint = 0
        self._is_ending = False
        self._start = time.monotonic()
        self._bar = tqdm(
            total=schedule.total_decisions,
            unit=" decisions",
            disable=not schedule.progress_bar,
            # a log file gets a line now and then, a terminal a moving bar
            mininterval=0.5 if sys.stderr.isatty() else 30,
            dynamic_ncols=True,
        )

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a checkpoint says of the run."""
        self._evaluations = state["evaluations"]
        self._best = state["best"]
        self._next_evaluation = state["next_evaluation"]
        self._next_checkpoint = state["next_checkpoint"]
        self._start -= state["wall_time_s"]
        self._bar.initial = state["decisions"]
        self._bar.reset()

    def close(self) -> None:
        """Leave the terminal in order."""
        self._bar.close()

    def _on_step(self) -> bool:
        # set, not added up: the last update may go beyond the total
        total = self._config.training.total_decisions
        self._bar.update(min(self.num_timesteps, total) - self._bar.n)
        return not self._is_ending

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next_evaluation:
            self._evaluate()
            self._next_evaluation = self.num_timesteps + self._config.training.evaluation_interval
        if self.num_timesteps >= self._next_checkpoint or self._interrupted:
            self._next_checkpoint = self.num_timesteps + self._config.training.checkpoint_interval
            self._save_checkpoint()
        # the decision that follows is the last one, and not in the checkpoint: nothing is lost
        self._is_ending = bool(self._interrupted)

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

    def _save_checkpoint(self) -> None:
        schedule = self._config.training
        state = {
            "learner": learner_state(self.model),
            "env": _env_of(self.model).snapshot(),
            "run": {
                "decisions": self.num_timesteps,
                "evaluations": self._evaluations,
                "best": self._best,
                "next_evaluation": self._next_evaluation,
                "next_checkpoint": self._next_checkpoint,
                "wall_time_s": time.monotonic() - self._start,
            },
        }
        save_checkpoint(self._folder.checkpoint(self.num_timesteps), state)
        self._folder.drop_checkpoints(keep=schedule.checkpoints_kept)

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
