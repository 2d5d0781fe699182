"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.entry import Start, run_command
from flyrl.cli.errors import LEFT_OUT
from flyrl.cli.sweep import Interrupted, by_key
from flyrl.entry_points import check_trust

if TYPE_CHECKING:
    from flyrl.cli.config import EvaluationSettings
    from flyrl.evaluation import EvaluationConfig
    from flyrl.training.config import TrainingConfig
    from flyrl.training.learn import Run
    from flyrl.training.runs import RunSummary

_BESIDE_RESUME: Final = ("resume", "trust", "evaluate_after", "evaluation", "video_after")


def main(subcommand: Sequence[str] = ()) -> None:
    """Check the command line, then run; the last line printed is `run: <folder>`.

    Parameters
    ----------
    subcommand
        What stands between the program and its arguments: `train`, of `flyrl train`.
    """
    run_command("train", run, end_of_sweep, subcommand)


def run(record: dict[str, Any], start: Start) -> Path:
    """Train as a composed `configs/train.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    start
        How the command was started. In the folder of a sweep, a run that comes to the same is gone
        on with, with its own settings, or left as it is if it is finished.

    Returns
    -------
    The run folder.

    Raises
    ------
    SystemExit
        Interrupted (128 + the signal's number); or with status 1 if someone is out of the
        comparison, unless this is a job of a sweep: that goes on.
    """
    # Imported here so that a mistyped key is reported at once, before torch and MuJoCo load.
    from flyrl.cli.config import evaluation_settings, group, training_config  # noqa: PLC0415
    from flyrl.cli.evaluate import comparison, results_folder  # noqa: PLC0415
    from flyrl.progress import whole_job  # noqa: PLC0415
    from flyrl.validation import file_path, one_of  # noqa: PLC0415

    for key in ("evaluate_after", "video_after", "trust"):
        one_of(key, record[key], (False, True))
    is_compared, shares = record["evaluate_after"], {}
    runs = start.sweep or file_path("runs_folder", record["runs_folder"])
    asked = record["resume"]
    interrupted = None if asked is None else file_path("resume", asked)
    if interrupted:
        _check_nothing_changes(start.overrides)
        from flyrl.training.runs import read_record  # noqa: PLC0415

        settings_of_run = read_record(interrupted)
        check_trust(interrupted, settings_of_run, record["trust"], "trust=true")
        record = {**record, **settings_of_run}
    config = training_config(record)
    if config.logger is not None:
        config.logger.check_installed()
    settings = evaluation_settings(group(record, "evaluation"))
    if is_compared:
        # a mistake in it shows before the training, not after
        shares = _shares(config, comparison(record, settings, start.command), settings)
        if settings.folder is not None:
            results_folder(settings.folder)
    if not interrupted and (earlier := _earlier(config, start)):
        if earlier.state == "finished":
            print(f"run: {earlier.path}", flush=True)
            return earlier.path
        interrupted = earlier.path
        config = training_config({**record, **earlier.settings})
    from flyrl.front.runs import illustrate  # noqa: PLC0415

    show = partial(illustrate, config, with_video=record["video_after"])
    report, is_complete = None, True
    with whole_job(shares):
        finished = _learn(config, start, interrupted, runs, show)
        if finished.interrupted_by is None and is_compared:
            report, is_complete = _compare(record, settings, start, finished.folder)
    if report is not None:
        print(f"report: {report}")
    # at once: of a sweep's workers, whose output is buffered, it would come after the sweep's end
    print(f"run: {finished.folder}", flush=True)
    if finished.interrupted_by is not None:
        print(f"interrupted; go on with: resume={finished.folder}", file=sys.stderr)
    if finished.signal is not None:  # of a run that came to its end, too: a sweep ends here
        raise Interrupted(finished.folder, finished.signal)
    if not is_complete and start.sweep is None:
        raise SystemExit(LEFT_OUT)
    return finished.folder


def _learn(
    config: TrainingConfig,
    start: Start,
    interrupted: Path | None,
    runs: Path,
    show: Callable[[Run], None],
) -> Run:
    """Resume an interrupted run, or train a new one in `runs`."""
    # a wrong value has been reported by now, without torch
    from flyrl.training.learn import resume, train  # noqa: PLC0415

    try:
        if interrupted:
            return resume(config, interrupted, start.command, at_end=show)
        return train(config, runs, start.command, start.label, at_end=show)
    except OSError as error:
        raise _with_way_on(error, config, interrupted or runs) from error


def _compare(
    record: dict[str, Any], settings: EvaluationSettings, start: Start, run: Path
) -> tuple[Path, bool]:
    """Compare the policy of a run; return the report's path, and whether everyone is in it."""
    from flyrl.cli.evaluate import compare, comparison  # noqa: PLC0415

    with_run = replace(
        settings, given={**settings.given, "policies": [str(run), *settings.given["policies"]]}
    )
    folder = Path(settings.folder or run / "evaluation")
    return compare(comparison(record, with_run, start.command), folder, settings)


def _shares(
    config: TrainingConfig, compared: EvaluationConfig, settings: EvaluationSettings
) -> dict[str, float]:
    """Parts of a training with a comparison -> how long each takes, in simulated s of training.

    Measured in `experiment=main` on two cores. Empty if no progress is to be shown.

    Parameters
    ----------
    config
        Of the training.
    compared, settings
        Of the comparison, without the policy that is to be trained.
    """
    from flyrl.evaluation import make_entrants  # noqa: PLC0415

    if not config.training.progress_bar:
        return {}
    walks = (len(make_entrants(compared)) + 1) * len(compared.terrain_configs)
    simulated_s = walks * len(compared.conditions) * compared.episodes * compared.horizon_s
    return {
        "training": config.training.total_timesteps * config.env.decision_interval_s,
        "evaluating": 0.5 * simulated_s,
        "filming": 75.0 * walks * len(compared.film) if settings.videos else 0.0,
        "reporting": 150.0,
    }


def end_of_sweep(folder: Path) -> None:
    """Compare the runs of a sweep in a table and in a figure."""
    from flyrl.cli.sweeps import compare_sweep  # noqa: PLC0415

    compare_sweep(folder)


def _check_nothing_changes(overrides: Sequence[str]) -> None:
    """Raise ValueError if the command line asks a resumed run for another setting."""
    for override in overrides:
        key = override.lstrip("+~").partition("=")[0]
        if key.partition(".")[0] not in _BESIDE_RESUME:
            raise ValueError(
                f"resume continues with the run's own settings; {key!r} cannot be given with it "
                f"(allowed are {', '.join(_BESIDE_RESUME[1:])})"
            )


def _with_way_on(error: OSError, config: TrainingConfig, runs: Path) -> OSError:
    """The error of the system that ended a run, with how to go on where that left a checkpoint.

    Parameters
    ----------
    error
        It need not say which file it is about.
    config
        Of the run.
    runs
        Its folder, or the one that it was made in.
    """
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    if error.errno is None or not runs.is_dir():
        return error
    for folder in reversed(find_runs(runs, depth=1)):  # the latest first, by name
        run = read_run(folder)
        if run.has_checkpoint and run.settings == training_record(config):
            return OSError(f"{error}; once {folder} can be written to, go on with: resume={folder}")
    return error


def _earlier(config: TrainingConfig, start: Start) -> RunSummary | None:
    """The finished or interrupted run in a sweep that comes to the same as one with these settings.

    Of the settings without an effect on the result, which another launcher has others of, only
    those count that were asked for.

    Raises
    ------
    ValueError
        Another process is at it.
    """
    from flyrl.front.comparison import with_effect  # noqa: PLC0415
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.runs import find_runs, read_run  # noqa: PLC0415

    if start.sweep is None:
        return None
    asked = tuple(by_key(start.overrides))
    wanted = with_effect(training_record(config), but=asked)
    found: RunSummary | None = None
    for path in find_runs(start.sweep):
        run = read_run(path)
        if with_effect(run.settings, but=asked) != wanted:
            continue
        if run.state == "finished":
            return run
        if run.state == "running":
            raise ValueError(f"another process trains in {path}")
        if run.state == "interrupted" and run.has_checkpoint:
            found = found or run
    return found
