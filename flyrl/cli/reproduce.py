"""flyrl reproduce: repeat a run or the evaluation behind a report, and name what differs."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any

from flyrl.cli.terminal import Subparsers, path_argument, program
from flyrl.entry_points import check_trust
from flyrl.text import printable


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "reproduce",
        help="repeat a run, or the evaluation of a report, and compare",
        description="Train again, from the settings of a finished run, in a new folder; then say "
        "whether the final policy and the evaluations are the same, to the bit. Or walk the "
        "episodes of a report again.",
        epilog="Exit status: 0 if they are, 1 if not, 2 for an error. Example: flyrl reproduce "
        "runs/2026-01-31_120000_target_flat_ppo_0",
    )
    path: dict[str, Any] = {"type": path_argument, "metavar": "FOLDER"}
    parser.add_argument("original", **path, help="of the run to repeat, or a report.html")
    parser.add_argument(
        "--runs-folder", **path, default=Path("runs"), help="where to (default: runs)"
    )
    parser.add_argument(
        "--repeat",
        **path,
        help="compare with this repeat, made before; one that was interrupted is resumed first",
    )
    parser.add_argument("--output", **path, help="of a report: where to write the repeat's")
    parser.add_argument(
        "--trust",
        action="store_true",
        help="run the code that it names (terms, policies as module:attribute, pickles)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Repeat the run, or the evaluation of a report, and compare.

    Returns
    -------
    The exit status: 0 if every figure is the same to the bit, 1 if not, or that of an interruption.

    Raises
    ------
    ValueError
        It is no finished run or report, its settings cannot be used here, or need trust.
    OSError
        A file cannot be read, or written.
    """
    if options.original.suffix in (".html", ".htm"):
        return _reproduce_report(options)
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.training.learn import repeat_run  # noqa: PLC0415
    from flyrl.training.provenance import check_repeatable, compare  # noqa: PLC0415
    from flyrl.training.runs import read_run  # noqa: PLC0415

    original = read_run(options.original)
    check_repeatable(original)  # so that damage shows before hours of training
    check_trust(options.original, original.settings, options.trust, "--trust")
    settings = {key: value for key, value in original.settings.items() if key != "logger"}
    if options.repeat is None:
        print("repeating the run", file=sys.stderr)
    command = [*program(), *sys.argv[1:]]
    again = repeat_run(training_config(settings), options.runs_folder, options.repeat, command)
    if again.interrupted_by is not None:
        resume = ["flyrl", "reproduce", str(options.original), "--repeat", str(again.folder)]
        print(f"interrupted; resume with: {shlex.join(resume)}", file=sys.stderr)
        return 128 + again.interrupted_by
    result = compare(original, read_run(again.folder))
    print(f"policy: {result.policy or 'identical, bit for bit'}")
    print(f"evaluations: {printable(result.evaluations or 'identical')}")
    for line in result.origins or ("same code, packages and CPU",):
        print(f"where from: {line}")
    print(f"repeat: {again.folder}")
    return int(not result.is_identical)


def _reproduce_report(options: argparse.Namespace) -> int:
    """Walk the episodes of a report again; print what differs."""
    from flyrl.cli.config import evaluation_config, evaluation_settings  # noqa: PLC0415
    from flyrl.front.results import (  # noqa: PLC0415
        compare,
        differences_from_report,
        results_folder,
    )
    from flyrl.report import read_origin  # noqa: PLC0415

    path, output = options.original, options.output
    record = read_origin(path)["settings"]
    if not record:
        raise ValueError(f"{path} was not made by evaluate.py or train.py: it holds no settings")
    check_trust(path, record, options.trust, "--trust")
    settings = evaluation_settings({**record, "progress_bar": True})
    config = evaluation_config(record, settings, " ".join(sys.argv))
    if output is not None:
        results_folder(output)
    results = compare(config)
    is_same, lines = differences_from_report(path, results)
    if output is not None:
        print(f"repeat: {results.write(output, videos=False, close_ups=False)}")
    print(f"episodes: {'identical, bit for bit' if is_same else 'they differ'}")
    print(*(lines or ["same policies and packages"]), sep="\n")
    return int(not is_same)
