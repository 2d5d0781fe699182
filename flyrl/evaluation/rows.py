"""Rows of results, one per episode, and their paths: in memory, as plain values, in files."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.metrics import METRICS, episode_metrics
from flyrl.rollouts import EpisodeRecord
from flyrl.text import csv_table

Json = dict[str, Any]

_TEXT: Final = (str,)
_OPTIONAL: Final = (int, float, type(None))

ROW_KEYS: Final[Mapping[str, tuple[type, ...]]] = {
    "controller": _TEXT,
    "task": _TEXT,
    "terrain": _TEXT,
    "episode": (int,),
    "seed": (int,),
    "outcome": _TEXT,
    "success": (bool,),
    "condition": _TEXT,
    **dict.fromkeys(METRICS, _OPTIONAL),
}
"""Columns, and the types of their values in JSON; errors of a user's own task come after them."""

_DTYPES: Final = {
    key: "category" if types == _TEXT else "float64"
    for key, types in ROW_KEYS.items()
    if types in (_TEXT, _OPTIONAL)
}
_CHUNK: Final = 10_000
"""Rows that are turned into text at a time."""


def episode_row(record: EpisodeRecord, condition: str = "") -> Json:
    """Row of one episode, walked under a condition: plain values, None where there is none."""
    return {
        "controller": record.controller,
        "task": record.task,
        "terrain": record.terrain,
        "episode": record.index,
        "seed": record.seed,
        "outcome": record.outcome,
        "success": record.success,
        "condition": condition,
        **episode_metrics(record),
    }


def episode_table(rows: Sequence[Json]) -> pd.DataFrame:
    """Table of rows: text as categories, numbers as float64 with NaN for None.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    for row in rows:
        for key, value in row.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(
                    f"{key} must be finite or None, got {value} in episode {row['episode']} of "
                    f"{row['controller']}"
                )
    own = [key for key in (rows[0] if rows else ()) if key not in ROW_KEYS]
    for key in own:
        if not key.isidentifier():
            raise ValueError(f"a metric must be a word of letters, digits and _, got {key!a:.60}")
    table = pd.DataFrame(rows, columns=[*ROW_KEYS, *own])
    return table.astype({**_DTYPES, **dict.fromkeys(own, "float64")})


def metric_columns(table: pd.DataFrame) -> list[str]:
    """Metrics in a table of rows: `METRICS`, then errors of a user's own task."""
    return [*METRICS, *(str(key) for key in table.columns if key not in ROW_KEYS)]


def joined(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Tables one below the other."""
    return pd.concat(tables, ignore_index=True).astype(_DTYPES)


def plain_rows(table: pd.DataFrame) -> Iterator[Json]:
    """Rows of a table as `episode_row` makes them."""
    for chunk in _chunks(table):
        for row in chunk.to_dict("records"):
            yield {
                str(key): None if isinstance(value, float) and math.isnan(value) else value
                for key, value in row.items()
            }


def csv_text(table: pd.DataFrame) -> Iterator[str]:
    """Text of `episodes.csv`, piece by piece: a header, then a line per row; None is empty."""
    yield csv_table(table.head(0))
    for chunk in _chunks(table):
        yield csv_table(chunk, header=False)


def episodes_digest(table: pd.DataFrame) -> str:
    """SHA-256 of `episodes.csv`, in hexadecimal: equal for the same results, to the bit."""
    digest = hashlib.sha256()
    for text in csv_text(table):
        digest.update(text.encode())
    return digest.hexdigest()


def _chunks(table: pd.DataFrame) -> Iterator[pd.DataFrame]:
    for start in range(0, len(table), _CHUNK):
        yield table.iloc[start : start + _CHUNK]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Path of one episode: float32 arrays over its samples, fields as in `EpisodeRecord`."""

    time_s: NDArray[np.float32]
    position_w: NDArray[np.float32]
    yaw: NDArray[np.float32]
    drive: NDArray[np.float32]


def trajectory(record: EpisodeRecord) -> Trajectory:
    """Path of one episode, in single precision."""
    return Trajectory(
        record.time_s.astype(np.float32),
        record.position_w.astype(np.float32),
        record.yaw.astype(np.float32),
        record.drive.astype(np.float32),
    )


def pack_trajectories(paths: Sequence[Trajectory]) -> dict[str, Any]:
    """Plain arrays of many paths: how long each is, and their fields one after the other."""
    if not paths:
        return {"lengths": np.zeros(0, dtype=np.int64)}
    columns = {
        key: np.concatenate([getattr(path, key) for path in paths])
        for key in Trajectory.__dataclass_fields__
    }
    return {"lengths": np.array([len(path.time_s) for path in paths], dtype=np.int64), **columns}


def unpack_trajectories(arrays: Mapping[str, NDArray[Any]]) -> list[Trajectory]:
    """Paths from what `pack_trajectories` made of them.

    Raises
    ------
    KeyError
        An array is missing.
    """
    if not arrays["lengths"].size:
        return []
    cuts = np.cumsum(arrays["lengths"])[:-1]
    columns = [np.split(arrays[key], cuts) for key in Trajectory.__dataclass_fields__]
    return [Trajectory(*fields) for fields in zip(*columns, strict=True)]
