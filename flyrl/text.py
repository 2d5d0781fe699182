"""Text from files of others, made harmless where it is shown: terminals, spreadsheets, pages."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pandas import DataFrame

_FORMULA: Final = re.compile(r" *[=+\-@\uff1d\uff0b\uff0d\uff20]")
"""Start of a text that spreadsheets run, also in full width."""


def printable(text: str, keep: str = "") -> str:
    """`text` in one line, with a question mark for every control character that is not kept."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else " " if c.isspace() else "?" for c in text)


def plain_name(text: str) -> str:
    """`text` as it can stand in the names of files and in attributes of HTML and SVG."""
    return re.sub(r"[^\w.-]", "_", text, flags=re.ASCII)[:100]


def csv_cell(value: Any) -> Any:
    """Value of a CSV cell: text in one line, which no spreadsheet runs as a formula.

    Such text gets an apostrophe; numbers, also those in text, stay as they are.
    """
    if not isinstance(value, str):
        return value
    text = printable(value)
    if not _FORMULA.match(text):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def csv_text(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """Text of a CSV file: a header, then a line per row; None is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(csv_cell, columns))
    writer.writerows([csv_cell(row.get(column)) for column in columns] for row in rows)
    return text.getvalue()


def csv_table(table: "DataFrame", **options: Any) -> str:
    """Text of a CSV file with a table, without its index.

    Parameters
    ----------
    options
        As for `pandas.DataFrame.to_csv`.
    """
    text = table.select_dtypes(exclude=["number", "bool"])
    safe = table.assign(**{str(column): text[column].map(csv_cell) for column in text})
    rows: str = safe.rename(columns=csv_cell).to_csv(index=False, lineterminator="\n", **options)
    return rows
