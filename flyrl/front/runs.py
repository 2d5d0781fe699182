"""Trainings: settings go in, a run comes out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from flyrl.evaluation import Entrant, EvaluationConfig, make_entrants
from flyrl.files import write_bytes
from flyrl.report import record_videos, write_learning_curve
from flyrl.tasks import Task, TaskSettings
from flyrl.terrains import Terrain
from flyrl.training.config import TrainingConfig, config_from_keywords, training_record
from flyrl.training.learn import Run
from flyrl.training.learn import resume as resume_run
from flyrl.training.learn import train as start
from flyrl.training.loggers import LoggerConfig
from flyrl.training.runs import find_runs, read_run, training_returns


class TrainingInterrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM ended a training in order: policy and checkpoint are saved.

    Attributes
    ----------
    run
        The run as far as it came; `resume=` continues it, here or in `python train.py`.
    """

    def __init__(self, run: Run) -> None:
        state = "is finished" if run.interrupted_by is None else "can be resumed"
        super().__init__(f"interrupted; the run {state}: {run.folder}")
        self.run = run


def train(
    task: TaskSettings | Task = "target",
    algo: str = "ppo",
    *,
    seed: int = 0,
    total_timesteps: int | None = None,
    logger: str | LoggerConfig | None = None,
    runs_folder: str | Path = "runs",
    resume: str | Path | Run | None = None,
    video_after: bool = True,
    **settings: Any,
) -> Run:
    """Train a policy, with the bits of `python train.py` with the same settings.

    Parameters
    ----------
    task
        Name of the task, e.g. "target", or a task of your own.
    algo
        Name of the algorithm, e.g. "ppo" or "sac".
    seed
        Of the network, the exploration and the episodes.
    total_timesteps
        Decisions to collect, over all flies.
    logger
        "wandb", "mlflow" or settings of one: where the metrics go beside the run folder.
    runs_folder
        Folder in which the run's own folder is made.
    resume
        An interrupted run of the same settings, or its folder: it resumes from its latest
        checkpoint, and ends with the bits of an uninterrupted one.
    video_after
        Whether to film the best policy on a held-out episode, where a GL library can be used.
    settings
        Settings of the environment (`terrain`, `controller`, `physics`, …: see `EnvConfig`), of
        the task (`distance`, …: docs/tasks.md), of the algorithm (`learning_rate`, `gamma`, …:
        docs/settings.md) and of the schedule (`num_envs`, `evaluation_interval`, …: see
        `ScheduleConfig`). Those that are not given are the ones tuned for task and algorithm, else
        the usual ones.

    Returns
    -------
    The run.

    Raises
    ------
    TypeError
        A setting that does not exist; the message names the closest one. A ValueError, too.
    ValueError
        A value that is not allowed, a run that cannot be resumed, or the training diverged.
    TrainingInterrupted
        After Ctrl-C or SIGTERM, with the run as far as it came. A KeyboardInterrupt.
    """
    if total_timesteps is not None:
        settings["total_timesteps"] = total_timesteps
    config = config_from_keywords(task, algo, seed=seed, logger=logger, **settings)
    run = learn(config, runs_folder, folder=resume, with_video=video_after)
    if run.signal is not None:  # what follows shall not start, even if the run came to its end
        raise TrainingInterrupted(run)
    return run


def learn(
    config: TrainingConfig,
    runs: str | Path = "runs",
    command: Sequence[str] = (),
    label: str = "",
    *,
    folder: str | Path | Run | None = None,
    with_video: bool = True,
) -> Run:
    """Train a new run, or resume one, and illustrate its folder.

    Parameters
    ----------
    config, runs, command, label
        As in `flyrl.training.learn.train`.
    folder
        Of an interrupted run of the same config, to resume.
    with_video
        Whether to film the best policy.

    Raises
    ------
    ValueError
        As in `flyrl.training.learn.train` and `resume`.
    OSError
        A folder cannot be written to; the message says how to resume once it can.
    """
    at_end = partial(illustrate, config, with_video=with_video)
    try:
        if folder is None:
            return start(config, runs, command, label, at_end=at_end)
        return resume_run(config, Path(folder), command, at_end=at_end)
    except OSError as error:
        written = Path(folder or runs)
        if error.errno is not None and written.is_dir():
            for path in reversed(find_runs(written, depth=1)):  # the latest first, by name
                run = read_run(path)
                if run.has_checkpoint and run.settings == training_record(config):
                    raise OSError(
                        f"{error}; once {path} can be written to, resume with: resume={path}"
                    ) from error
        raise


def simulated_shares(
    config: TrainingConfig,
    compared: EvaluationConfig,
    entrants: Sequence[Entrant],
    *,
    videos: bool,
) -> dict[str, float]:
    """Parts of a training with a comparison -> how long each takes, in simulated s on a plane.

    Measured in the main job, on two cores.

    Parameters
    ----------
    config
        Of the training.
    compared, entrants
        Of the comparison, without the policy that is to be trained.
    videos
        Whether anyone is filmed.
    """
    grounds = sum(map(_cost_of_ground, compared.terrain_configs))
    training_s = config.env.decision_interval_s * _cost_of_ground(config.env.scene.terrain)
    filmed = 2 if compared.film == "contrast" else len(entrants) + 1
    films = filmed * sum(map(len, compared.filmed().values()))
    walks = (len(entrants) + 1) * len(compared.conditions) * compared.episodes
    schedule = config.training
    return {
        "teacher": 0.55 * schedule.num_demonstrations * training_s,
        "training": schedule.total_timesteps * training_s,
        "evaluating": 0.5 * walks * compared.horizon_s * grounds,
        "filming": 35.0 * films if videos else 0.0,
        "reporting": 35.0,
    }


def _cost_of_ground(terrain: Terrain) -> float:
    """Time that physics takes over a ground, over that on a plane."""
    return 2.0 if terrain.is_rough else 1.0


def illustrate(config: TrainingConfig, finished: Run, *, with_video: bool) -> None:
    """Draw the learning curve into the run folder; at the end, film the best policy too."""
    folder = finished.folder
    write_learning_curve(folder, read_run(folder).evaluations, training_returns(folder))
    best = folder / "best.safetensors"
    if with_video and finished.interrupted_by is None and best.exists():
        scene = config.env.scene
        episodes = EvaluationConfig(
            policies=(str(best),),
            controllers=(),
            task=config.env.resolved_task,
            terrains=(scene.terrain,),
            body=scene.body,
            physics=scene.physics,
            randomisation=config.env.resolved_randomisation,
            episodes=1,
        )
        videos, _ = record_videos(episodes, make_entrants(episodes))
        for video in videos:
            write_bytes(folder / "best.mp4", video.mp4)
