"""flyrl sweep: the table of a sweep, at any time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_to(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "sweep",
        help="compare the runs of a sweep over their seeds",
        description="Print the table that a sweep ends with, and write it to its comparison.csv; "
        "also of one that is still going on, or was killed.",
    )
    parser.add_argument("folder", type=Path, help="of the sweep, as in runs/sweeps")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print and write the table."""
    from flyrl.cli.comparison import compare_sweep  # noqa: PLC0415

    compare_sweep(options.folder)
    return 0
