"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from flyrl.cli.entry import Start, by_key, run_command
from flyrl.cli.terminal import LEFT_OUT, Ended
from flyrl.entry_points import check_trust

_BESIDE_RESUME: Final = ("resume", "trust", "evaluate_after", "evaluation", "video_after")


def main(subcommand: Sequence[str] = ()) -> None:
    """Check the command line, then run; the last line printed is `run: <folder>`.

    Parameters
    ----------
    subcommand
        What stands between the program and its arguments: `train`, of `flyrl train`.
    """
    run_command("train", run, end_of_sweep, subcommand)


def run(record: dict[str, Any], start: Start) -> None:
    """Train as a composed `configs/train.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    start
        How the command was started. In the folder of a sweep, an interrupted run of equal
        settings is resumed with its own, and a finished one left as it is.

    Raises
    ------
    SystemExit
        Interrupted (128 + the signal's number); or with status 1 if an entrant
        crashed in the comparison, unless this is a job of a sweep.
    """
    # Imported here so that a mistyped key is reported at once, before torch and MuJoCo load.
    from flyrl.cli.config import (  # noqa: PLC0415
        evaluation_settings,
        group,
        report_config,
        training_config,
    )
    from flyrl.cli.evaluate import comparison  # noqa: PLC0415
    from flyrl.progress import whole_job  # noqa: PLC0415
    from flyrl.validation import file_path, one_of  # noqa: PLC0415

    for key in ("evaluate_after", "video_after", "trust"):
        one_of(key, record[key], (False, True))
    runs = start.sweep or file_path("runs_folder", record["runs_folder"])
    resumed = None if record["resume"] is None else file_path("resume", record["resume"])
    if resumed:
        record = {**record, **_settings_of_run(resumed, start.overrides, record["trust"])}
    settings = evaluation_settings(group(record, "evaluation"))
    config = training_config(record)
    if config.logger is not None:
        config.logger.check_installed()
    # a mistake in it shows before the training, not after
    compared = comparison(record, settings, start.command) if record["evaluate_after"] else None
    # a wrong value has been reported by now, without torch
    from flyrl.front.comparison import earlier_run  # noqa: PLC0415
    from flyrl.front.results import compare, results_folder  # noqa: PLC0415
    from flyrl.front.runs import learn, simulated_shares  # noqa: PLC0415

    if compared and settings["folder"] is not None:
        results_folder(settings["folder"])
    shares: dict[str, float] = {}
    if compared and config.training.progress_bar:
        shares = simulated_shares(config, *compared, videos=settings["videos"])
    is_new = start.sweep and not resumed
    earlier = earlier_run(config, runs, [*by_key(start.overrides)]) if is_new else None
    if earlier and earlier.state == "finished":
        print(f"run: {earlier.path}", flush=True)
        return
    if earlier:
        resumed, config = earlier.path, training_config({**record, **earlier.settings})
    report, is_complete = None, True
    with whole_job(shares):
        finished = learn(
            config,
            runs,
            start.command,
            start.label,
            folder=resumed,
            with_video=record["video_after"],
        )
        run = finished.folder
        if finished.interrupted_by is None and compared:
            with_run = {**settings, "policies": [str(run), *settings["policies"]]}
            folder = Path(settings["folder"] or run / "evaluation")
            with_policy, entrants = comparison(record, with_run, start.command)
            results = compare(with_policy, folder, entrants)
            report = results.write(folder, **asdict(report_config(settings)))
            is_complete = results.is_complete
    if report is not None:
        print(f"report: {report}")
    # at once: of a sweep's workers, whose output is buffered, it would come after the sweep's end
    print(f"run: {run}", flush=True)
    if finished.interrupted_by is not None:
        print(f"interrupted; resume with: resume={run}", file=sys.stderr)
    if finished.signal is not None:  # of a run that came to its end, too: a sweep ends here
        raise Ended(128 + finished.signal)
    if not is_complete and start.sweep is None:
        raise SystemExit(LEFT_OUT)


def end_of_sweep(folder: Path) -> None:
    """Compare the runs of a sweep, if there are any, in a table and in a figure."""
    from flyrl.cli.runs import compare_folders  # noqa: PLC0415
    from flyrl.training.runs import find_runs  # noqa: PLC0415

    if find_runs(folder):
        compare_folders([folder], folder)


def _settings_of_run(folder: Path, overrides: Sequence[str], is_trusted: bool) -> dict[str, Any]:
    """Settings of a run to resume; ValueError if the command line asks for another, or for code."""
    for override in overrides:
        key = override.lstrip("+~").partition("=")[0]
        if key.partition(".")[0] not in _BESIDE_RESUME:
            raise ValueError(
                f"resume continues with the run's own settings; {key!r} cannot be given with it "
                f"(allowed are {', '.join(_BESIDE_RESUME[1:])})"
            )
    from flyrl.training.runs import read_record  # noqa: PLC0415

    settings = read_record(folder)
    check_trust(folder, settings, is_trusted, "trust=true")
    return settings
