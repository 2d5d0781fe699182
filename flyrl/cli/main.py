"""flyrl: one command, with a subcommand for what there is to do beside training and comparing."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Final

from flyrl.cli import figures, play, reproduce, runs, sweeps, tune

_SUBCOMMANDS: Final = (runs, sweeps, reproduce, tune, figures, play)
"""Modules with `add_to(subparsers)`, which names the function that runs the subcommand."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Parameters
    ----------
    arguments
        Without the program; None takes those of the command line.

    Returns
    -------
    The exit status.

    Raises
    ------
    SystemExit
        With status 2, for a command line that cannot be meant so.
    """
    options = command_parser().parse_args(arguments)
    try:
        status: int = options.run(options)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return status


def command_parser() -> argparse.ArgumentParser:
    """Make the parser of the whole command."""
    parser = argparse.ArgumentParser(
        prog="flyrl",
        description="Look at training runs, compare, repeat and tune them; draw figures; play.",
    )
    subparsers = parser.add_subparsers(metavar="command", required=True)
    for module in _SUBCOMMANDS:
        module.add_to(subparsers)
    return parser
