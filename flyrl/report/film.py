"""A video on its own, with the numbers that it shows."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from PIL import Image

from flyrl.files import write_bytes, write_text
from flyrl.report.captions import Picture
from flyrl.text import csv_table


@dataclass(frozen=True)
class Film:
    """A video on its own.

    Attributes
    ----------
    mp4
        The file: H.264, yuv420p.
    poster
        A picture of it, a JPEG file, to be shown until it plays.
    table
        The numbers that it shows.
    """

    mp4: bytes
    poster: bytes
    table: pd.DataFrame


def jpeg(picture: Picture) -> bytes:
    """A picture as a JPEG file."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=80)
    return buffer.getvalue()


def write_film(film: Film, folder: Path, name: str) -> None:
    """Write name.mp4, name.jpg and name.csv to a folder, made if missing.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / f"{name}.mp4", film.mp4)
    write_bytes(folder / f"{name}.jpg", film.poster)
    write_text(folder / f"{name}.csv", csv_table(film.table, float_format="%.6g"))
