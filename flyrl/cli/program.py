"""Command line of this process for records, arguments that are paths, tables on the terminal."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from flyrl.text import printable

if TYPE_CHECKING:
    from rich.text import Text


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


NOTHING: Final = "-"
_PIPE_WIDTH: Final = 1000
"""Characters of a line that goes into a file or a pipe, where nothing needs folding."""

Row = Mapping[str, Any]


def print_table(columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Print rows under the heads of their columns; numbers to the right, nothing as a dash."""
    from rich import box  # noqa: PLC0415
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        is_number = all(isinstance(row.get(column), int | float | None) for row in rows)
        table.add_column(_text(column), justify="right" if is_number else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_text(row.get(column)) for column in columns))
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _PIPE_WIDTH
    console.print(table)


def _text(value: Any) -> Text:
    """A cell; what a stranger's file holds cannot move the cursor or colour the terminal."""
    from rich.text import Text  # noqa: PLC0415

    if value is None:
        return Text(NOTHING)
    if isinstance(value, float):
        return Text(f"{value:.4g}")
    return Text(printable(str(value)))
