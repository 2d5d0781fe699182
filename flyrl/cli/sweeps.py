"""flyrl sweep: the table and the learning curves of a sweep, or of several, at any time."""

from __future__ import annotations

import argparse

from flyrl.cli.program import Subparsers, path_argument


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "sweep",
        help="compare the runs of sweeps over their seeds",
        description="Print the table that a sweep ends with, and write it and the learning curves "
        "to its folder; also of one that is still going on, or was killed. Of several folders, of "
        "sweeps and of single runs, make one table and one figure.",
        epilog="Example: flyrl sweep runs/sweeps/2026-01-31_120000",
    )
    parser.add_argument(
        "folders",
        nargs="+",
        type=path_argument,
        metavar="FOLDER",
        help="of a sweep, as in runs/sweeps; two or more may be of single runs too",
    )
    parser.add_argument(
        "--output",
        type=path_argument,
        metavar="FOLDER",
        help="where comparison.csv and learning_curves go (default: the folder of the one sweep)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print and write what the folders hold."""
    from flyrl.cli.comparison import compare_folders, compare_sweep  # noqa: PLC0415

    if len(options.folders) == 1:
        compare_sweep(options.folders[0], options.output)
    elif options.output is None:
        raise ValueError("several folders need --output, the folder to write to")
    else:
        compare_folders(options.folders, options.output)
    return 0
