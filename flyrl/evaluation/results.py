"""The results of an evaluation, and the files they live in.

A folder of results holds

- `results.json`: schema `flyrl.results/3`: protocol, the episodes as they were drawn, one row per
  walked episode, one summary per controller and terrain;
- `episodes.csv`: the same rows, for a spreadsheet;
- `trajectories.npz`: the paths that were kept, and the rows they belong to; plain arrays.

Each is written beside its place and then moved there, so that a crash leaves the old file whole.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.rows import (
    ROW_KEYS,
    Json,
    Trajectory,
    csv_text,
    episode_table,
    episodes_digest,
    pack_trajectories,
    plain_rows,
    unpack_trajectories,
)
from flyrl.evaluation.tables import differences_table, summary_table
from flyrl.files import OutputFolder, load_arrays
from flyrl.rollouts import EpisodeRecord
from flyrl.tasks import OUTCOMES

SCHEMA: Final = "flyrl.results/3"
RESULTS_FILE: Final = "results.json"
EPISODES_FILE: Final = "episodes.csv"
TRAJECTORIES_FILE: Final = "trajectories.npz"
RESULTS_FILES: Final = (RESULTS_FILE, EPISODES_FILE, TRAJECTORIES_FILE)

_TEXT: Final = (str,)
_NUMBER: Final = (int, float)
_NAME_LENGTH: Final = 1000

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
        One row per walked episode: see `flyrl.evaluation.rows`.
    summaries
        One per terrain, condition and controller: see `SUMMARY_KEYS`.
    drawn
        The episodes that everybody walks, by terrain; plain values, made when asked for.
    trajectories
        Those that were kept, by the number of their row.
    examples
        Records of the episodes to film that were walked in this process; no file holds them.
    """

    protocol: Json
    episodes: pd.DataFrame
    summaries: list[Json]
    drawn: Mapping[str, Sequence[Json]] = field(default_factory=dict)
    trajectories: Mapping[int, Trajectory] = field(default_factory=dict)
    examples: Sequence[EpisodeRecord] = ()

    @property
    def summary(self) -> pd.DataFrame:
        """The summaries as a table: success with its interval, and the spread of every metric."""
        return summary_table(self.summaries)

    @property
    def differences(self) -> pd.DataFrame:
        """Paired comparisons with the reference as a table, a row per metric."""
        return differences_table(self.summaries)

    def to_json(self) -> Json:
        """The contents of `results.json`."""
        return {
            "schema": SCHEMA,
            "protocol": self.protocol,
            "drawn": {terrain: list(episodes) for terrain, episodes in self.drawn.items()},
            "episodes": list(plain_rows(self.episodes)),
            "summary": self.summaries,
        }


def write_results(results: Results, folder: str | Path) -> Path:
    """Write all files of `results` to `folder`, each whole or not at all; return `results.json`.

    Raises
    ------
    ResultsError
        If the results do not follow the schema, or hold a number that is not finite.
    OSError
        The folder cannot be written to, or holds such a file that flyrl did not write.
    """
    output = OutputFolder(folder)
    output.check_free(*RESULTS_FILES)
    with output.replacing(RESULTS_FILE) as partial:
        _write_pieces(partial, results_text(results))
        # these before it takes its place: whoever reads it finds all three
        with output.replacing(EPISODES_FILE) as table:
            _write_pieces(table, csv_text(results.episodes))
        if results.trajectories:
            with output.replacing(TRAJECTORIES_FILE) as trajectories:
                _save_trajectories(trajectories, results)
        else:
            output.remove(TRAJECTORIES_FILE)
    return output.path / RESULTS_FILE


def _write_pieces(path: Path, pieces: Iterable[str]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(pieces)


def load_results(path: str | Path) -> Results:
    """Read results from their folder, or from their `results.json`.

    Paths that belong to other rows (an evaluation stopped between two files) are left out.

    Raises
    ------
    ResultsError
        If there is no such file, or it is not a whole `flyrl.results/3`.
    """
    path = Path(path)
    if path.is_dir():
        path = path / RESULTS_FILE
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ResultsError(f"{path}: no such file") from None
    except (ValueError, RecursionError) as error:
        raise ResultsError(f"{path}: not JSON ({error})") from None
    try:
        validate(contents)
        episodes = episode_table(contents["episodes"])
    except ValueError as error:
        raise ResultsError(f"{path}: {error}") from None
    return Results(
        contents["protocol"],
        episodes,
        contents["summary"],
        contents["drawn"],
        _load_trajectories(path.parent, episodes),
    )


def validate(contents: object) -> None:
    """Check that `contents` follows schema `flyrl.results/3`.

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
    _check_keys(contents, _CONTENTS, "results")
    outcomes = _check_protocol(contents["protocol"])
    for index, row in enumerate(contents["episodes"]):
        _check_row(row, index, outcomes)
        _check_names(row, f"episodes[{index}]")
    for index, row in enumerate(contents["summary"]):
        _check_keys(row, SUMMARY_KEYS, f"summary[{index}]")
        _check_names(row, f"summary[{index}]")


_CONTENTS: Final = {"protocol": (dict,), "drawn": (dict,), "episodes": (list,), "summary": (list,)}


def _check_protocol(protocol: Json) -> list[str]:
    """Check a protocol; return the outcomes that its episodes can have."""
    _check_keys(protocol, PROTOCOL_KEYS, "protocol")
    # a protocol without its own is of flyrl's own tasks
    protocol = {"outcomes": list(OUTCOMES[1:]), **protocol}
    _check_keys(protocol, {"outcomes": (list,)}, "protocol")
    return [str(outcome) for outcome in protocol["outcomes"]]


def _check_row(row: object, index: int, outcomes: Sequence[str]) -> None:
    where = f"episodes[{index}]"
    _check_keys(row, ROW_KEYS, where)
    assert isinstance(row, dict)
    if row["outcome"] not in outcomes:
        raise ResultsError(
            f"{where}.outcome: {row['outcome']!r}; expected one of {', '.join(outcomes)}"
        )


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


def _check_names(row: Json, where: str) -> None:
    """Names reach figures, tables and terminals."""
    for key in ("controller", "task", "terrain", "condition", "outcome"):
        name = row.get(key, "")
        if not name.isprintable() or len(name) > _NAME_LENGTH:
            raise ResultsError(
                f"{where}.{key}: {name!a:.60}; expected printable text of at most "
                f"{_NAME_LENGTH} characters"
            )


def results_text(results: Results) -> Iterator[str]:
    """Text of `results.json`, piece by piece: valid JSON without NaN, a line per episode.

    Raises
    ------
    ResultsError
        If the results do not follow the schema, or hold a number that is not finite.
    """
    outcomes = _check_protocol(results.protocol)
    for index, row in enumerate(results.summaries):
        _check_keys(row, SUMMARY_KEYS, f"summary[{index}]")
    try:
        yield f'{{\n "schema": {json.dumps(SCHEMA)},\n "protocol": '
        yield json.dumps(results.protocol, indent=1, allow_nan=False)
        yield ',\n "drawn": {'
        for number, (terrain, episodes) in enumerate(results.drawn.items()):
            yield f"{',' * (number > 0)}\n  {json.dumps(terrain)}: ["
            yield from _lines(episodes)
            yield "]"
        yield '\n },\n "episodes": ['
        yield from _lines(_checked(plain_rows(results.episodes), outcomes))
        yield '],\n "summary": ['
        yield from _lines(results.summaries)
        yield "]\n}\n"
    except ValueError as error:
        raise ResultsError(str(error)) from error


def _lines(values: Iterable[Json]) -> Iterator[str]:
    """Values of a JSON list, a line each."""
    for index, value in enumerate(values):
        yield f"{',' * (index > 0)}\n  {json.dumps(value, allow_nan=False)}"


def _checked(rows: Iterable[Json], outcomes: Sequence[str]) -> Iterator[Json]:
    for index, row in enumerate(rows):
        _check_row(row, index, outcomes)
        yield row


def _digest(table: pd.DataFrame) -> NDArray[np.uint8]:
    """What ties paths to the rows they belong to, 32 bytes."""
    return np.frombuffer(bytes.fromhex(episodes_digest(table)), dtype=np.uint8)


def _save_trajectories(path: Path, results: Results) -> None:
    rows, paths = list(results.trajectories), list(results.trajectories.values())
    np.savez_compressed(
        path,
        digest=_digest(results.episodes),
        rows=np.array(rows, dtype=np.int64),
        **pack_trajectories(paths),
    )


def _load_trajectories(folder: Path, table: pd.DataFrame) -> dict[int, Trajectory]:
    path = folder / TRAJECTORIES_FILE
    if not path.exists():
        return {}
    try:
        arrays = load_arrays(path)
        if not np.array_equal(arrays["digest"], _digest(table)):
            return {}
        return dict(zip(arrays["rows"].tolist(), unpack_trajectories(arrays), strict=True))
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{path}: not a whole trajectories file ({error})") from error
