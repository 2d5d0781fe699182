"""flyrl train and flyrl evaluate: what `train.py` and `evaluate.py` do, arguments untouched."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import Final

from flyrl.cli.program import Subparsers

COMPOSED: Final = {
    "train": "train a policy, and film it",
    "evaluate": "compare policies and controllers in a report",
}
"""Subcommands whose arguments are Hydra's, and what each does."""

_FLAGS: Final = {
    "--help": "the settings, and what can be chosen for each",
    "--multirun": "a run for every combination of the values that are given; or -m",
    "--cfg": "print the settings: job, hydra or all",
    "--resolve": "with --cfg: with what is interpolated",
}


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommands to what is listed and completed; their arguments are never parsed."""
    for name, about in COMPOSED.items():
        parser = subparsers.add_parser(name, help=about, add_help=False)
        for flag, text in _FLAGS.items():
            parser.add_argument(flag, action="store_true", help=text)
        parser.add_argument("overrides", nargs=argparse.REMAINDER, metavar="KEY=VALUE")


def run(name: str, arguments: Sequence[str]) -> int:
    """Run `train` or `evaluate` as its own script would.

    Parameters
    ----------
    name
        Of the subcommand.
    arguments
        What follows it.

    Raises
    ------
    SystemExit
        As of the script.
    """
    before = sys.argv
    sys.argv = [before[0], *arguments]  # where Hydra reads them
    try:
        importlib.import_module(f"flyrl.cli.{name}").main(subcommand=(name,))
    finally:
        sys.argv = before
    return 0
