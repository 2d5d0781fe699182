"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig

from flyrl.cli.arguments import fail
from flyrl.cli.entry import run_command


def main() -> None:
    """Check the command line, then run; the last line printed is `run: <folder>`."""
    run_command("train", run)


def run(record: dict[str, Any]) -> None:
    """Train as a composed `configs/train.yaml` says.

    Parameters
    ----------
    record
        Plain values, resolved.
    """
    # Imported here so that a mistyped key is reported at once, before torch and MuJoCo load.
    from flyrl.cli.config import evaluation_settings, training_config  # noqa: PLC0415
    from flyrl.cli.evaluate import compare, comparison  # noqa: PLC0415
    from flyrl.training.checkpoint import ResumeError  # noqa: PLC0415
    from flyrl.training.learn import resume, train  # noqa: PLC0415
    from flyrl.training.run_folder import read_record  # noqa: PLC0415

    is_compared = bool(record["evaluate_after"])
    interrupted = record["resume"] and Path(record["resume"])
    command = [sys.executable, *sys.argv]
    try:
        if interrupted:
            _check_nothing_changes(HydraConfig.get().overrides.task)
            record = {**record, **read_record(interrupted)}
        config = training_config(record)
        settings = evaluation_settings(record["evaluation"], "evaluation")
        if is_compared:
            comparison(record, settings)  # a mistake in it shows before the training, not after
    except ValueError as error:
        fail(error)
    try:
        if interrupted:
            finished = resume(config, interrupted, command)
        else:
            finished = train(config, record["runs_folder"], command)
    except (ResumeError, OSError) as error:
        fail(error)
    if finished.interrupted_by is None and is_compared:
        with_run = replace(settings, policies=(str(finished.folder), *settings.policies))
        folder = settings.folder or finished.folder / "evaluation"
        report = compare(comparison(record, with_run), Path(folder), settings.videos)
        print(f"report: {report}")
    print(f"run: {finished.folder}")
    if finished.interrupted_by is not None:
        print(f"interrupted; go on with: resume={finished.folder}", file=sys.stderr)
        raise SystemExit(128 + finished.interrupted_by)


def _check_nothing_changes(overrides: Sequence[str]) -> None:
    """Raise ValueError if the command line asks a resumed run for another setting."""
    for override in overrides:
        key = override.lstrip("+~").partition("=")[0]
        if key.partition(".")[0] not in {"resume", "evaluate_after", "evaluation"}:
            raise ValueError(
                f"resume goes on with the run's own settings; {key!r} cannot be given with it "
                "(allowed are evaluate_after and evaluation)"
            )
