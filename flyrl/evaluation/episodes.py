"""Rows and paths of walked episodes: in tables, in arrays, and in batches kept on the way."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.metrics import METRICS, episode_metrics
from flyrl.files import OutputFolder, load_arrays
from flyrl.rollouts import EpisodeRecord
from flyrl.text import csv_table

Json = dict[str, Any]

_DTYPES: Final = {
    **dict.fromkeys(("controller", "task", "terrain"), "category"),
    **dict.fromkeys(("episode", "seed"), "int64"),
    "outcome": "category",
    "success": "bool",
    "condition": "category",
    **dict.fromkeys(METRICS, "float64"),
}
"""Columns of a table of episodes; errors of a user's own task come after them, as float64."""

PARTS_FOLDER: Final = "parts"
_NAME_LENGTH: Final = 1000


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Path of one episode: float32 arrays over its samples, fields as in `EpisodeRecord`."""

    time_s: NDArray[np.float32]
    position_w: NDArray[np.float32]
    yaw: NDArray[np.float32]
    drive: NDArray[np.float32]


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
    """Table of rows: see `Results.episodes`.

    Raises
    ------
    ValueError
        A number is not finite, or a metric has no name that can stand in a table.
    """
    for row in rows:
        for key, value in row.items():
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(
                    f"{key} must be finite or None, got {value} in episode {row['episode']} of "
                    f"{row['controller']}"
                )
    return typed(pd.DataFrame(rows))


def typed(table: pd.DataFrame) -> pd.DataFrame:
    """A table of episodes: text as categories, metrics as float64 with NaN for None."""
    own = metric_columns(table)[len(METRICS) :]
    for key in own:
        if not key.isidentifier():
            raise ValueError(f"a metric must be a word of letters, digits and _, got {key!a:.60}")
    return table.astype({**_DTYPES, **dict.fromkeys(own, "float64")})


def metric_columns(table: pd.DataFrame) -> list[str]:
    """Metrics in a table of episodes: `METRICS`, then errors of a user's own task."""
    return [*METRICS, *(str(key) for key in table.columns if key not in _DTYPES)]


def episodes_digest(table: pd.DataFrame) -> str:
    """SHA-256 of `episodes.csv`, in hexadecimal: equal for the same results, to the bit."""
    return hashlib.sha256(csv_table(table).encode()).hexdigest()


def read_episodes(csv: bytes) -> pd.DataFrame:
    """Table of episodes from the text of a CSV file.

    Raises
    ------
    ValueError
        It is none, or holds a number that is not finite or a name that cannot be shown.
    """
    # as text first: not every parser of numbers comes to the last bit
    table = pd.read_csv(BytesIO(csv), dtype=object, keep_default_na=False)
    if missing := [key for key in _DTYPES if key not in table]:
        raise ValueError(f"column {missing[0]!r} is missing")
    if not table["success"].isin(("True", "False")).all():
        raise ValueError("success must be True or False")
    metrics = metric_columns(table)
    table[metrics] = table[metrics].replace("", "nan")
    table["success"] = table["success"] == "True"
    table = typed(table)
    if np.isinf(table[metrics]).any(axis=None):
        raise ValueError("metrics must be finite")
    for key in table.select_dtypes("category"):
        check_names(table[key].cat.categories, str(key))
    return table


def trajectory(record: EpisodeRecord) -> Trajectory:
    """Path of one episode, in single precision."""
    return Trajectory(
        *(getattr(record, item.name).astype(np.float32) for item in fields(Trajectory))
    )


def pack_trajectories(paths: Mapping[int, Trajectory]) -> dict[str, Any]:
    """Plain arrays of many paths: their rows, how long each is, their fields joined together."""
    columns = {
        item.name: np.concatenate([getattr(path, item.name) for path in paths.values()])
        for item in fields(Trajectory)
        if paths
    }
    lengths = [len(path.time_s) for path in paths.values()]
    return {
        "rows": np.array(list(paths), dtype=np.int64),
        "lengths": np.array(lengths, dtype=np.int64),
        **columns,
    }


def unpack_trajectories(arrays: Mapping[str, NDArray[Any]]) -> dict[int, Trajectory]:
    """Paths by their rows, from what `pack_trajectories` made of them.

    Raises
    ------
    KeyError, ValueError
        An array is missing, or of another length than the others.
    """
    if not arrays["rows"].size:
        return {}
    cuts = np.cumsum(arrays["lengths"])[:-1]
    columns = [np.split(arrays[item.name], cuts) for item in fields(Trajectory)]
    paths = [Trajectory(*values) for values in zip(*columns, strict=True)]
    return dict(zip(arrays["rows"].tolist(), paths, strict=True))


def check_names(names: Iterable[str], where: str) -> None:
    """Names reach figures, tables and terminals."""
    for name in names:
        if not name.isprintable() or len(name) > _NAME_LENGTH:
            raise ValueError(
                f"{where}: {name!a:.60}; expected printable text of at most {_NAME_LENGTH} "
                "characters"
            )


Part = tuple[pd.DataFrame, dict[int, Trajectory]]
"""Rows of a batch, and the paths of the first of them by the number of their row."""


class Parts:
    """Batches of episodes in a folder, of an evaluation of certain settings.

    Parameters
    ----------
    folder
        Of the results. None keeps nothing.
    settings
        Plain JSON values; what was walked with others does not count.
    """

    def __init__(self, folder: str | Path | None, settings: Any) -> None:
        self._folder = None if folder is None else OutputFolder(folder)
        self._settings = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()

    def read(self, walk: int, start: int) -> Part | None:
        """Rows and paths of a batch; None where there are none, or not whole.

        Parameters
        ----------
        walk
            Number of the entrant, terrain and condition.
        start
            First episode of the batch.
        """
        if self._folder is None:
            return None
        try:
            arrays = load_arrays(self._folder.path / self._name(walk, start))
            return read_episodes(arrays["table"].tobytes()), unpack_trajectories(arrays)
        except (OSError, KeyError, OverflowError, TypeError, ValueError):
            return None

    def write(self, walk: int, start: int, part: Part) -> None:
        """Keep a batch.

        Raises
        ------
        OSError
            The folder cannot be written to.
        """
        if self._folder is None:
            return
        rows, paths = part
        table = np.frombuffer(rows.to_csv(index=False).encode(), dtype=np.uint8)
        with self._folder.replacing(self._name(walk, start)) as partial:
            np.savez_compressed(partial, table=table, **pack_trajectories(paths))

    def _name(self, walk: int, start: int) -> str:
        return f"{PARTS_FOLDER}/{walk}-{start}-{self._settings[:16]}.npz"


def drop_parts(folder: Path) -> None:
    """Drop the batches in a folder of results, once these hold them."""
    output = OutputFolder(folder)
    output.remove(*output.files(PARTS_FOLDER))
