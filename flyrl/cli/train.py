"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.arguments import fail
from flyrl.cli.entry import Start, run_command
from flyrl.cli.sweep import Interrupted

if TYPE_CHECKING:
    from flyrl.training.config import TrainingConfig
    from flyrl.training.learn import Run

_BESIDE_RESUME: Final = ("resume", "evaluate_after", "evaluation", "video_after")


def main() -> None:
    """Check the command line, then run; the last line printed is `run: <folder>`."""
    run_command("train", run, end_of_sweep)


def run(record: dict[str, Any], start: Start) -> Path:
    """Train as a composed `configs/train.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    start
        How the command was started. In the folder of a sweep, a run with these settings is gone on
        with, or left as it is if it is finished.

    Returns
    -------
    The run folder.
    """
    # Imported here so that a mistyped key is reported at once, before torch and MuJoCo load.
    from flyrl.cli.config import evaluation_settings, training_config  # noqa: PLC0415
    from flyrl.cli.evaluate import compare, comparison  # noqa: PLC0415

    is_compared = bool(record["evaluate_after"])
    interrupted = Path(record["resume"]) if record["resume"] else None
    try:
        if interrupted:
            _check_nothing_changes(start.overrides)
            from flyrl.training.run_folder import read_record  # noqa: PLC0415

            record = {**record, **read_record(interrupted)}
        config = training_config(record)
        if config.logger is not None:
            config.logger.check_installed()
        settings = evaluation_settings(record["evaluation"], "evaluation")
        if is_compared:
            # a mistake in it shows before the training, not after
            comparison(record, settings, start.command)
    except ValueError as error:
        fail(error)
    if start.sweep and not interrupted:
        interrupted, is_finished = _earlier(config, start.sweep)
        if interrupted and is_finished:
            print(f"run: {interrupted}", flush=True)
            return interrupted
    # a wrong value has been reported by now, without torch
    from flyrl.training.checkpoint import ResumeError  # noqa: PLC0415
    from flyrl.training.learn import resume, train  # noqa: PLC0415

    show = partial(illustrate, config, with_video=bool(record["video_after"]))
    try:
        if interrupted:
            finished = resume(config, interrupted, start.command, at_end=show)
        else:
            finished = train(
                config, start.sweep or record["runs_folder"], start.command, at_end=show
            )
    except (ResumeError, OSError) as error:
        fail(error)
    if finished.interrupted_by is None and is_compared:
        with_run = replace(settings, policies=(str(finished.folder), *settings.policies))
        folder = settings.folder or finished.folder / "evaluation"
        entrants = comparison(record, with_run, start.command)
        report = compare(entrants, Path(folder), settings.videos)
        print(f"report: {report}")
    # at once: of a sweep's workers, whose output is buffered, it would come after the sweep's end
    print(f"run: {finished.folder}", flush=True)
    if finished.interrupted_by is not None:
        print(f"interrupted; go on with: resume={finished.folder}", file=sys.stderr)
    if finished.signal is not None:  # of a run that came to its end, too: a sweep ends here
        raise Interrupted(finished.folder, finished.signal)
    return finished.folder


def end_of_sweep(folder: Path) -> None:
    """Compare the runs of a sweep in a table and in a figure."""
    from flyrl.cli.comparison import compare_sweep  # noqa: PLC0415

    compare_sweep(folder)


def _check_nothing_changes(overrides: Sequence[str]) -> None:
    """Raise ValueError if the command line asks a resumed run for another setting."""
    for override in overrides:
        key = override.lstrip("+~").partition("=")[0]
        if key.partition(".")[0] not in _BESIDE_RESUME:
            raise ValueError(
                f"resume goes on with the run's own settings; {key!r} cannot be given with it "
                f"(allowed are {', '.join(_BESIDE_RESUME[1:])})"
            )


def _earlier(config: TrainingConfig, sweep: Path) -> tuple[Path | None, bool]:
    """Folder in a sweep of a run with these settings, and whether it is finished."""
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.run_folder import RunFolder  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    wanted = training_record(config)
    for path in find_runs(sweep):
        run = read_run(path)
        if run.settings == wanted:
            if run.state == "finished":
                return path, True
            if run.state == "interrupted" and RunFolder(path).checkpoints():
                return path, False
    return None, False


def illustrate(config: TrainingConfig, finished: Run, *, with_video: bool) -> None:
    """Draw the learning curve into the run folder; at the end, film the best policy too."""
    from flyrl.evaluation import EvaluationConfig  # noqa: PLC0415
    from flyrl.files import write_bytes  # noqa: PLC0415
    from flyrl.report import record_videos, write_learning_curve  # noqa: PLC0415
    from flyrl.training.run_folder import RunFolder  # noqa: PLC0415
    from flyrl.training.runs import read_run, training_returns  # noqa: PLC0415

    folder = finished.folder
    write_learning_curve(folder, read_run(folder).evaluations, training_returns(folder))
    best = RunFolder(folder).best
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
        videos, _ = record_videos(episodes)
        for video in videos:
            write_bytes(folder / "best.mp4", video.mp4)
