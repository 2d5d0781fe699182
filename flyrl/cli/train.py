"""flyrl-train: train a policy, and compare it with the fixed controllers if asked to."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

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
    from flyrl.training.learn import train  # noqa: PLC0415

    is_compared = bool(record["evaluate_after"])
    try:
        config = training_config(record)
        settings = evaluation_settings(record["evaluation"], "evaluation")
        if is_compared:
            comparison(record, settings)  # a mistake in it shows before the training, not after
    except ValueError as error:
        fail(error)
    finished = train(config, record["runs_folder"], [sys.executable, *sys.argv])
    if finished.interrupted_by is None and is_compared:
        with_run = replace(settings, policies=(str(finished.folder), *settings.policies))
        folder = settings.folder or finished.folder / "evaluation"
        report = compare(comparison(record, with_run), Path(folder), settings.videos)
        print(f"report: {report}")
    print(f"run: {finished.folder}")
    if finished.interrupted_by is not None:
        raise SystemExit(128 + finished.interrupted_by)
