"""flyrl sweep: the table and the learning curves of a sweep, or of several, at any time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flyrl.cli.program import Subparsers, path_argument

if TYPE_CHECKING:
    from flyrl.front.comparison import RunComparison


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
    if len(options.folders) == 1:
        compare_sweep(options.folders[0], options.output)
    elif options.output is None:
        raise ValueError("several folders need --output, the folder to write to")
    else:
        from flyrl.front.comparison import compare_folders  # noqa: PLC0415

        _print(compare_folders(options.folders, options.output))
    return 0


def compare_sweep(folder: Path, output: Path | None = None) -> None:
    """Compare the runs of a sweep: print the table, write it and the learning curves.

    Parameters
    ----------
    folder
        Of the sweep.
    output
        Where to write to; None is the folder of the sweep.

    Raises
    ------
    ValueError
        There is no sweep in the folder.
    OSError
        The folder cannot be written to.
    """
    from flyrl.cli.sweep import by_key, read_jobs  # noqa: PLC0415
    from flyrl.front.comparison import group_jobs, write_comparison  # noqa: PLC0415
    from flyrl.training.runs import read_run  # noqa: PLC0415

    jobs = [
        (by_key(job), read_run(folder / note.folder) if note and note.folder else None)
        for job, note in read_jobs(folder)
    ]
    _print(write_comparison(group_jobs(jobs), output or folder))


def _print(comparison: RunComparison) -> None:
    from flyrl.cli.program import print_table  # noqa: PLC0415

    print_table(list(comparison.rows[0]), comparison.rows)
    print(*comparison.notes, sep="\n")
