"""Training itself: a config goes in, a run folder with a policy comes out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import (
    CSVOutputFormat,
    Logger,
    TensorBoardOutputFormat,
)
from stable_baselines3.common.utils import LinearSchedule
from torch import nn
from torch.utils.tensorboard import SummaryWriter

from flyrl.envs.sb3 import FlyVecEnv
from flyrl.training.algorithms import AlgorithmConfig, PPOConfig, SACConfig
from flyrl.training.callback import RunCallback, fly_env
from flyrl.training.checkpoint import load_checkpoint, restore_learner
from flyrl.training.config import TrainingConfig
from flyrl.training.interruption import interruption
from flyrl.training.run_folder import RunFolder
from flyrl.training.runs import held, read_rows

_DECISIONS_LOGGED: Final = "time/total_timesteps"

_ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}


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
    run_folder = RunFolder.create(config, Path(runs), command)
    with held(run_folder.path):
        return _learn(config, model, run_folder, None)


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
        The folder cannot be written to, or another process trains in it; the latest checkpoint
        stays as it is.
    """
    run_folder = RunFolder.open(config, Path(folder), command)
    with held(run_folder.path):
        state = load_checkpoint(run_folder.latest_checkpoint())
        return _learn(config, _prepare(config), run_folder, state)


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
    env = fly_env(model)
    with interruption() as interrupted:
        callback = RunCallback(config, folder, interrupted)
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
        # the header is torn if a kill came while the table got a new column: no row is safe then
        rows = [row for row in read_rows(table) if _DECISIONS_LOGGED in row]
        rows = [row for row in rows if int(row[_DECISIONS_LOGGED]) <= decisions]
    csv_format = CSVOutputFormat(str(table))
    for row in rows:
        csv_format.write({key: _number(text) for key, text in row.items() if text}, {})
    return Logger(str(folder.path), [csv_format, tensorboard])


def _number(text: str) -> float:
    return int(text) if text.isdigit() else float(text)


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


def _episode_seed(seed: int) -> int:
    """Seed of fly 0; fly i has this plus i. Far apart for neighbouring seeds of runs."""
    return int(np.random.default_rng(seed).integers(2**30))
