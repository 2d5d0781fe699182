"""flyrl compile: compile the controllers now, so that no later start waits for it."""

from __future__ import annotations

import argparse
import time

from flyrl.cli.program import Subparsers


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "compile",
        help="compile the controllers now, instead of at the first start",
        description="Compile the controllers, unless that is done, and print where they are kept: "
        "in __pycache__ beside the sources, or in the folder NUMBA_CACHE_DIR.",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compile and print the time that it took, and the folders."""
    from flyrl.simulation.callback import cache_folders, install  # noqa: PLC0415

    start = time.perf_counter()
    install()
    print(f"controllers ready after {time.perf_counter() - start:.1f} s")
    for folder in cache_folders():
        print(f"cache: {folder}")
    return 0
