"""How this process was started, for records that say how to repeat it; arguments that are paths."""

import argparse
import sys
from pathlib import Path
from typing import Any, Protocol


class Subparsers(Protocol):
    """What `ArgumentParser.add_subparsers` returns."""

    def add_parser(self, name: str, **settings: Any) -> argparse.ArgumentParser:
        """Parser of a new subcommand."""
        ...


def program() -> tuple[str, ...]:
    """Interpreter and program, without arguments."""
    script = Path(sys.argv[0])
    if script.name == "__main__.py":  # as python -m: the file by itself would not find its package
        return (sys.executable, "-m", script.parent.name)
    return (sys.executable, sys.argv[0])


def path_argument(text: str) -> Path:
    """Path on a command line; an empty one, as of an unset variable, is no path."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the path is empty")
    return Path(text)
