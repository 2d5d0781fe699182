"""Tables on the terminal."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

NOTHING: Final = "-"
_PIPE_WIDTH: Final = 1000
"""Characters of a line that goes into a file or a pipe, where nothing needs folding."""

Row = Mapping[str, Any]


def print_table(columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Print rows under the heads of their columns; numbers to the right, nothing as a dash."""
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


def csv_text(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """The same as CSV: a header, then a line per row; None is an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _text(value: Any) -> Text:
    """A cell; what a stranger's file holds cannot move the cursor or colour the terminal."""
    if value is None:
        return Text(NOTHING)
    if isinstance(value, float):
        return Text(f"{value:.4g}")
    return Text(printable(str(value)))


def printable(text: str) -> str:
    """What a stranger's file holds, with a question mark for every control character."""
    return "".join(c if c.isprintable() else "?" for c in text)
