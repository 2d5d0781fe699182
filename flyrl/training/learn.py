"""Training itself: a config goes in, a run folder with a policy comes out."""

import base64
import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.policies import LearnedPolicy, load_bundle
from flyrl.training.algorithms import ON_POLICY
from flyrl.training.callback import GoesOn, RunCallback, fly_env, interruption
from flyrl.training.config import WITHOUT_EFFECT, TrainingConfig, training_record
from flyrl.training.imitation import imitate, teacher_of
from flyrl.training.loggers import Outcome
from flyrl.training.metrics import RemoteLog, metrics_logger
from flyrl.training.models import build_model, restore_learner
from flyrl.training.run_folder import create_folder, load_latest_checkpoint, note_resumption
from flyrl.training.runs import CONFIG_FILE, ResumeError, flat, held, read_run
from flyrl.validation import one_of


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes
    ----------
    folder
        Its folder.
    interrupted_by
        Number of the signal that ended it early, or None.
    is_pruned
        Whether `goes_on` ended it early.
    signal
        Number of the signal that came, also if it was too late to end the run early: nothing that
        takes long should follow it. Or None.
    """

    folder: Path
    interrupted_by: int | None
    is_pruned: bool = False
    signal: int | None = None

    def __fspath__(self) -> str:
        return str(self.folder)

    def policy(self, which: Literal["best", "last"] = "best") -> LearnedPolicy:
        """Load the policy with the best evaluation, or that of the end.

        Raises
        ------
        PolicyFileError
            The file cannot be read; of an interrupted run, there may be no best one yet.
        """
        one_of("which", which, ("best", "last"))
        return LearnedPolicy(load_bundle(self.folder / f"{which}.safetensors"))

    @property
    def learning_curve(self) -> pd.DataFrame:
        """Evaluations on the held-out episodes, a row each.

        Columns: `decisions` so far, `success_rate`, `mean_return`, `mean_duration_s`, `advance_mm`
        along x, the task's mean errors, and totals of the reward's terms without their weights as
        `unweighted_…`.
        """
        return pd.DataFrame(read_run(self.folder).evaluations)

    def _repr_html_(self) -> str:
        drawn = self.folder / "learning_curve.svg"
        picture = ""
        if drawn.exists():
            data = base64.b64encode(drawn.read_bytes()).decode()
            picture = f'<img alt="learning curve" src="data:image/svg+xml;base64,{data}">'
        return f"<p>{html.escape(str(self.folder))}</p>{picture}"


_LARGEST_WEIGHT: Final = 1e5
"""Networks that learn something have weights of about 1."""


def train(
    config: TrainingConfig,
    runs: str | Path = "runs",
    command: Sequence[str] = (),
    label: str = "",
    *,
    goes_on: GoesOn | None = None,
    at_end: Callable[[Run], None] | None = None,
) -> Run:
    """Train a policy.

    Parameters
    ----------
    config
        What to train, in what, how long.
    runs
        Folder in which the run folder is made.
    command
        The command that asked for it, for the record.
    label
        End of the run folder's name.
    goes_on
        Asked after every evaluation; False ends the run, as an interruption does.
    at_end
        Called with the run after the training, or its interruption; the files that it makes in the
        folder go to the run's logger as well.

    Returns
    -------
    The run; its folder loads with `flyrl.load_policy`.

    Raises
    ------
    ValueError
        The logger's package is missing.
    LoggerError
        The logger cannot be used. Once training has begun, that is a warning.
    """
    if config.training.teacher is not None:
        teacher_of(config)  # before there is a folder; a run that is resumed needs it no more
    model = _prepare(config)
    folder = create_folder(config, Path(runs), command, label)
    with held(folder):
        return _learn(config, model, folder, None, goes_on, at_end)


def resume(
    config: TrainingConfig,
    folder: str | Path,
    command: Sequence[str] = (),
    *,
    goes_on: GoesOn | None = None,
    at_end: Callable[[Run], None] | None = None,
) -> Run:
    """Resume an interrupted run, from its latest checkpoint, to the end.

    On the same machine and versions, it ends with the policy that it would have had without the
    interruption, to the bit; on others, a warning says so. Of checkpoints that are damaged, those
    before them take the place.

    Parameters
    ----------
    config
        As the run was started with.
    folder
        Its folder.
    command, goes_on, at_end
        As in `train`.

    Raises
    ------
    ResumeError
        There is no run in the folder, it has other settings, it is finished, a file of it is
        damaged, or there is no checkpoint that can be read.
    ValueError
        The logger's package is missing.
    OSError
        The folder cannot be written to, or another process trains in it; the latest checkpoint
        stays as it is.
    """
    folder = Path(folder)
    run = read_run(folder)
    # before a lock is left where there is no run
    if run.problems:
        raise ResumeError(f"cannot resume {folder}: {'; '.join(run.problems)}")
    if run.state == "finished":
        raise ResumeError(f"cannot resume {folder}: the run has already finished")
    _check_settings(config, folder, run.settings, CONFIG_FILE)
    with held(folder):
        state = load_latest_checkpoint(folder)
        _check_settings(config, folder, state["settings"], "latest checkpoint", WITHOUT_EFFECT)
        model = _prepare(config)
        note_resumption(config, folder, command)
        return _learn(config, model, folder, state, goes_on, at_end)


def repeat_run(
    config: TrainingConfig, runs: Path, repeat: Path | None, command: Sequence[str] = ()
) -> Run:
    """Train anew in `runs`, or finish a repeat that was made before.

    Parameters
    ----------
    config
        Settings of the original; without its logger, to which a repeat says nothing.
    runs
        Folder in which the run folder is made.
    repeat
        Run folder of an earlier repeat; if it was interrupted, it is resumed.
    command
        The command that asked for it, for the record.

    Raises
    ------
    ValueError
        `repeat` is a run of other settings, or cannot be resumed.
    """
    if repeat is None:
        return train(config, runs, command)
    earlier = read_run(repeat)
    settings = {key: value for key, value in earlier.settings.items() if key != "logger"}
    if settings != training_record(config):
        raise ValueError(f"{repeat} is no repeat: it has other settings")
    if earlier.state == "finished":
        return Run(repeat, None)
    return resume(config, repeat, command)


def _check_settings(
    config: TrainingConfig,
    folder: Path,
    record: Mapping[str, Any],
    where: str,
    free: tuple[str, ...] = (),
) -> None:
    """Raise ResumeError if a setting, unless it is free, is not that of a record of the run."""
    then, now = flat(record), flat(training_record(config))
    for key in {**then, **now}:
        if then.get(key) != now.get(key) and not key.startswith(free):
            raise ResumeError(
                f"cannot resume {folder}: {key} is {then.get(key)!r:.60} in its {where}, not "
                f"{now.get(key)!r:.60}"
            )


def _prepare(config: TrainingConfig) -> BaseAlgorithm:
    """Untrained model in its environment; ValueError if something is missing for the run."""
    if config.logger is not None:
        config.logger.check_installed()
    torch.set_num_threads(config.training.torch_threads)
    env = FlyrlVecEnv(config.env, config.training.num_envs, config.training.num_threads)
    model = build_model(config.algo, env, config.seed)
    # of fly 0; fly i has this plus i. Far apart for neighbouring seeds of runs
    env.seed(int(np.random.default_rng(config.seed).integers(2**30)))
    return model


def _learn(
    config: TrainingConfig,
    model: BaseAlgorithm,
    folder: Path,
    state: dict[str, Any] | None,
    goes_on: GoesOn | None,
    at_end: Callable[[Run], None] | None,
) -> Run:
    """Learn until the end or an interruption; from a checkpoint's state, if there is one."""
    remote = None
    if config.logger is not None:
        remote = RemoteLog(config.logger, folder, training_record(config))
        if state is None:
            remote.connect()
    decisions = None if state is None else state["run"]["decisions"]
    outcome: Outcome = "failed"
    env = fly_env(model)
    try:
        model.set_logger(metrics_logger(folder, decisions, *filter(None, [remote])))
        with interruption() as interrupted:
            callback = RunCallback(config, folder, interrupted, goes_on)
            env.core.difficulty = callback.difficulty
            try:
                if state is not None:
                    _restore(model, callback, state, folder)
                elif config.training.teacher is not None:
                    imitate(model, config)
                model.learn(
                    config.training.total_timesteps - model.num_timesteps,
                    callback=callback,
                    log_interval=1 if config.algo.name in ON_POLICY else 4 * env.num_envs,
                    reset_num_timesteps=state is None,
                )
            except (RuntimeError, ValueError) as error:  # as PyTorch raises at the next action
                _check_diverged(model, folder, error)
                raise
            finally:
                callback.close()
                model.logger.close()
                env.close()
        signal = interrupted[0] if interrupted else None
        run = Run(folder, callback.interrupted_by, callback.is_pruned, signal)
        if at_end is not None:
            at_end(run)
        is_early = run.is_pruned or run.interrupted_by is not None
        outcome = "interrupted" if is_early else "finished"
    finally:
        if remote is not None:
            remote.finish(outcome)
    return run


def _check_diverged(model: BaseAlgorithm, folder: Path, error: Exception) -> None:
    """Raise ValueError if weights of the network are too large, or NaN."""
    weights = model.policy.parameters()
    if not all(bool((values.abs() <= _LARGEST_WEIGHT).all()) for values in weights):
        raise ValueError(
            f"the training in {folder} diverged after {model.num_timesteps} decisions: "
            f"weights of the network lie beyond {_LARGEST_WEIGHT:g}; lower algo.learning_rate, "
            "or the weights of the rewards"
        ) from error


def _restore(
    model: BaseAlgorithm, callback: RunCallback, state: Mapping[str, Any], folder: Path
) -> None:
    """Put a checkpoint back; ResumeError if it is not of such a run."""
    try:
        fly_env(model).restore(state["env"])
        restore_learner(model, state["learner"])
        callback.restore(state["run"])
    except (AttributeError, IndexError, KeyError, RuntimeError, TypeError, ValueError) as error:
        # whoever wrote the file may have put anything in it
        raise ResumeError(
            f"the latest checkpoint in {folder} does not fit the run: "
            f"{type(error).__name__}: {error!s:.200}"
        ) from error
