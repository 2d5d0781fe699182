"""flyrl reproduce: repeat a run from its settings, and say what differs."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

from flyrl.cli.program import Subparsers, path_argument, program
from flyrl.cli.reproduce_report import DIFFERENT, IDENTICAL, REPORTS, reproduce_report
from flyrl.entry_points import check_trust
from flyrl.text import printable
from flyrl.training.runs import read_run


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
    parser.add_argument(
        "original",
        type=path_argument,
        metavar="RUN",
        help="folder of the run to repeat, or a report.html",
    )
    parser.add_argument(
        "--runs-folder", type=path_argument, default=Path("runs"), help="where to (default: runs)"
    )
    parser.add_argument(
        "--repeat",
        type=path_argument,
        metavar="FOLDER",
        help="compare with this repeat, made before; one that was interrupted goes on first",
    )
    parser.add_argument(
        "--output",
        type=path_argument,
        metavar="FOLDER",
        help="of a report: where to write the repeat's",
    )
    parser.add_argument(
        "--trust",
        action="store_true",
        help="run the code that it names (terms, policies as module:attribute, pickles)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Repeat the run, or the evaluation, and compare."""
    if options.original.suffix in REPORTS:
        return reproduce_report(options.original, is_trusted=options.trust, output=options.output)
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.training.reproduce import check_repeatable, compare, repeat_run  # noqa: PLC0415

    original = read_run(options.original)
    check_repeatable(original)  # so that damage shows before hours of training
    check_trust(options.original, original.settings, options.trust, "--trust")
    settings = {key: value for key, value in original.settings.items() if key != "logger"}
    if options.repeat is None:
        print("repeating the run", file=sys.stderr)
    command = [*program(), *sys.argv[1:]]
    again = repeat_run(training_config(settings), options.runs_folder, options.repeat, command)
    if again.interrupted_by is not None:
        go_on = ["flyrl", "reproduce", str(options.original), "--repeat", str(again.folder)]
        print(f"interrupted; go on with: {shlex.join(go_on)}", file=sys.stderr)
        return 128 + again.interrupted_by
    result = compare(original, read_run(again.folder))
    print(f"policy: {result.policy or 'identical, bit for bit'}")
    print(f"evaluations: {printable(result.evaluations or 'identical')}")
    for line in result.origins or ("same code, packages and CPU",):
        print(f"where from: {line}")
    print(f"repeat: {again.folder}")
    return IDENTICAL if result.is_identical else DIFFERENT
