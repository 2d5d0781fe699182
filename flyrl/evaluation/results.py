"""The results of an evaluation, and the files they live in.

A folder of results holds

- `results.json`: schema `flyrl.results/2`: protocol, one row per episode, one summary per
  controller and terrain;
- `episodes.csv`: the same rows, for a spreadsheet;
- `trajectories.npz`: the paths, in the order of the rows; plain arrays.

Each is written beside its place and then moved there, so that a crash leaves the old file whole.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.evaluation.metrics import METRICS, episode_metrics
from flyrl.evaluation.trajectories import Trajectory, pack_trajectories, unpack_trajectories
from flyrl.files import replacing, write_text
from flyrl.rollouts.records import OUTCOMES, EpisodeRecord

SCHEMA: Final = "flyrl.results/2"
RESULTS_FILE: Final = "results.json"
EPISODES_FILE: Final = "episodes.csv"
TRAJECTORIES_FILE: Final = "trajectories.npz"

Json = dict[str, Any]

_TEXT: Final = (str,)
_NUMBER: Final = (int, float)
_OPTIONAL: Final = (int, float, type(None))

PROTOCOL_KEYS: Final[dict[str, tuple[type, ...]]] = {
    "command": _TEXT,
    "settings": (dict,),
    "versions": (dict,),
    "seed": (int,),
    "task": _TEXT,
    "horizon_s": _NUMBER,
    "reference": _TEXT,
    "entrants": (list,),
    "terrains": (list,),
    "study": (str, type(None)),
    "vary": (dict,),
    "crashes": (list,),
    "physics": (dict,),
}
ROW_KEYS: Final[dict[str, tuple[type, ...]]] = {
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
SUMMARY_KEYS: Final[dict[str, tuple[type, ...]]] = {
    "controller": _TEXT,
    "task": _TEXT,
    "terrain": _TEXT,
    "condition": _TEXT,
    "episodes": (int,),
    "successes": (int,),
    "outcomes": (dict,),
    "success_rate": (dict,),
    "metrics": (dict,),
    "paired": (dict, type(None)),
}


class ResultsError(ValueError):
    """A results file that is missing, broken or not ours; says which part and what was expected."""


@dataclass(frozen=True, eq=False)
class Results:
    """Results of an evaluation.

    Attributes
    ----------
    protocol
        How it was done, as plain JSON values: see `PROTOCOL_KEYS`.
    episodes
        One row per episode: see `ROW_KEYS`.
    summary
        One per terrain and controller: see `SUMMARY_KEYS`.
    trajectories
        One per row, in order; empty where they were not kept.
    """

    protocol: Json
    episodes: list[Json]
    summary: list[Json]
    trajectories: list[Trajectory] = field(default_factory=list)

    def to_json(self) -> Json:
        """The contents of `results.json`."""
        return {
            "schema": SCHEMA,
            "protocol": self.protocol,
            "episodes": self.episodes,
            "summary": self.summary,
        }


def episode_row(record: EpisodeRecord, condition: str = "") -> Json:
    """Row of `results.json` for one episode, walked under a condition."""
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


def write_results(results: Results, folder: str | Path) -> Path:
    """Write all files of `results` to `folder`, each whole or not at all; return `results.json`.

    Raises
    ------
    ResultsError
        If the results do not follow the schema.
    """
    folder = Path(folder)
    text = format_results(results.to_json())
    folder.mkdir(parents=True, exist_ok=True)
    if results.trajectories:
        _save_trajectories(folder / TRAJECTORIES_FILE, results)
    write_text(folder / EPISODES_FILE, format_episodes(results.episodes))
    write_text(folder / RESULTS_FILE, text)
    return folder / RESULTS_FILE


def load_results(path: str | Path) -> Results:
    """Read results from their folder, or from their `results.json`.

    Paths that belong to other rows (an evaluation stopped between two files) are left out.

    Raises
    ------
    ResultsError
        If there is no such file, or it is not a whole `flyrl.results/2`.
    """
    path = Path(path)
    if path.is_dir():
        path = path / RESULTS_FILE
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ResultsError(f"{path}: not JSON ({error})") from None
    try:
        validate(contents)
    except ResultsError as error:
        raise ResultsError(f"{path}: {error}") from None
    results = Results(contents["protocol"], contents["episodes"], contents["summary"])
    return replace(results, trajectories=_load_trajectories(path.parent, results.episodes))


def validate(contents: object) -> None:
    """Check that `contents` follows schema `flyrl.results/2`.

    Raises
    ------
    ResultsError
        At the first thing that does not, naming it.
    """
    if not isinstance(contents, dict):
        raise ResultsError(f"a {type(contents).__name__}; expected an object")
    schema = contents.get("schema")
    if schema != SCHEMA:
        raise ResultsError(f"schema: {schema!r}; this version reads {SCHEMA!r}")
    _check_keys(contents, {"protocol": (dict,), "episodes": (list,), "summary": (list,)}, "results")
    protocol = contents["protocol"]
    _check_keys(protocol, PROTOCOL_KEYS, "protocol")
    # a protocol without its own is of flyrl's own tasks
    protocol = {"outcomes": list(OUTCOMES), **protocol}
    _check_keys(protocol, {"outcomes": (list,)}, "protocol")
    outcomes = [str(outcome) for outcome in protocol["outcomes"]]
    for index, row in enumerate(contents["episodes"]):
        where = f"episodes[{index}]"
        _check_keys(row, ROW_KEYS, where)
        if row["outcome"] not in outcomes:
            raise ResultsError(
                f"{where}.outcome: {row['outcome']!r}; expected one of {', '.join(outcomes)}"
            )
    for index, row in enumerate(contents["summary"]):
        _check_keys(row, SUMMARY_KEYS, f"summary[{index}]")


def _check_keys(given: object, expected: Mapping[str, tuple[type, ...]], where: str) -> None:
    if not isinstance(given, dict):
        raise ResultsError(f"{where}: a {type(given).__name__}; expected an object")
    for key, types in expected.items():
        if key not in given:
            raise ResultsError(f"{where}.{key}: missing")
        value = given[key]
        # A bool is an int to Python, but no number to us.
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            names = " or ".join("null" if t is type(None) else t.__name__ for t in types)
            raise ResultsError(f"{where}.{key}: {value!r}; expected {names}")


def format_results(contents: Json) -> str:
    """Text of `results.json`: valid JSON without NaN, a line per episode.

    Raises
    ------
    ResultsError
        If `contents` does not follow the schema, or holds a number that is not finite.
    """
    validate(contents)
    try:
        parts = [f' "schema": {json.dumps(contents["schema"])}']
        protocol = json.dumps(contents["protocol"], indent=1, allow_nan=False)
        parts.append(f' "protocol": {protocol}')
        for key in ("episodes", "summary"):
            rows = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in contents[key])
            parts.append(f' "{key}": [\n{rows}\n ]')
    except ValueError as error:
        raise ResultsError(f"a number that is not finite ({error}); expected null") from error
    return "{\n" + ",\n".join(parts) + "\n}\n"


def format_episodes(rows: Sequence[Json]) -> str:
    """Text of `episodes.csv`: a header, then a line per row; null is an empty cell."""
    text = io.StringIO()
    columns = list(dict.fromkeys(key for row in rows for key in row)) or list(ROW_KEYS)
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def episodes_digest(rows: Sequence[Json]) -> str:
    """SHA-256 of `episodes.csv`, in hexadecimal: equal for the same results, to the bit."""
    return hashlib.sha256(format_episodes(rows).encode()).hexdigest()


def _digest(rows: Sequence[Json]) -> NDArray[np.uint8]:
    """What ties paths to the rows they belong to, 32 bytes."""
    return np.frombuffer(bytes.fromhex(episodes_digest(rows)), dtype=np.uint8)


def _save_trajectories(path: Path, results: Results) -> None:
    with replacing(path) as partial:
        np.savez_compressed(
            partial, digest=_digest(results.episodes), **pack_trajectories(results.trajectories)
        )


def _load_trajectories(folder: Path, rows: Sequence[Json]) -> list[Trajectory]:
    path = folder / TRAJECTORIES_FILE
    if not path.exists():
        return []
    try:
        # Opened here: np.load would leave a file that is not whole open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            if not np.array_equal(arrays["digest"], _digest(rows)):
                return []
            return unpack_trajectories(arrays)
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ResultsError(f"{path}: not a whole trajectories file ({error})") from error
