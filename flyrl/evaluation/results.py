"""Results of an evaluation, in memory and on disk.

A folder of results holds

- `episodes.csv`: a row per walked episode, with every digit;
- `trajectories.npz`: the paths that were kept, and the rows they belong to; plain arrays;
- `results.json`, schema `flyrl.results/4`: protocol, the episodes as they were drawn, a summary per
  controller and terrain, and the SHA-256 of the other two files.

Each is written beside its place and then moved there, so that a crash leaves the old file whole.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from flyrl.evaluation.episodes import (
    Json,
    Trajectory,
    check_names,
    pack_trajectories,
    read_episodes,
    unpack_trajectories,
)
from flyrl.files import OutputFolder, file_digest, load_arrays
from flyrl.rollouts import EpisodeRecord
from flyrl.text import csv_table

_Keys = Mapping[type, tuple[str, ...]]

SCHEMA: Final = "flyrl.results/4"
RESULTS_FILE: Final = "results.json"
EPISODES_FILE: Final = "episodes.csv"
TRAJECTORIES_FILE: Final = "trajectories.npz"
RESULTS_FILES: Final = (RESULTS_FILE, EPISODES_FILE, TRAJECTORIES_FILE)

_CONTENTS: Final[_Keys] = {dict: ("protocol", "drawn", "files"), list: ("summary",)}
_PROTOCOL: Final[_Keys] = {
    str: ("command", "task", "reference"),
    int: ("seed",),
    float: ("horizon_s",),
    dict: ("settings", "versions", "vary", "physics", "smallest_effects"),
    list: ("entrants", "terrains", "crashes", "decisive", "compared", "outcomes"),
    object: ("study",),
}
_SUMMARY: Final[_Keys] = {
    str: ("controller", "task", "terrain", "condition"),
    int: ("episodes", "successes"),
    dict: ("outcomes", "success_rate", "metrics"),
    object: ("paired",),
}
"""Keys of `results.json` by the type of their values."""


class ResultsError(ValueError):
    """A results file that is missing, broken or not ours; says which part and what was expected."""


@dataclass(frozen=True, eq=False)
class Results:
    """Results of an evaluation.

    Attributes
    ----------
    protocol
        How it was done, as plain JSON values.
    episodes
        One row per walked episode: controller, task, terrain, number, seed, outcome, condition, and
        every metric, NaN where there is none.
    summaries
        One per terrain, condition and controller: see `flyrl.evaluation.summary.summarise`.
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
        """The summaries as a table: success with its interval, and the spread of every metric.

        Of a metric `m` stand there `m_n`, the number of episodes that have it, `m_mean`,
        `m_median`, `m_q1` and `m_q3`; NaN without any.
        """
        return pd.DataFrame(
            {
                **place_of(row),
                "episodes": row["episodes"],
                "successes": row["successes"],
                "success_rate": row["success_rate"]["value"],
                "success_rate_low": row["success_rate"]["low"],
                "success_rate_high": row["success_rate"]["high"],
                **{
                    f"{metric}_{key}": row["metrics"][metric][key]
                    for metric in row["metrics"]
                    for key in ("n", "mean", "median", "q1", "q3")
                },
            }
            for row in self.summaries
        )

    @property
    def differences(self) -> pd.DataFrame:
        """Paired comparisons with the reference, a row per metric.

        Mean difference with its interval, or the reason why it has none; p-value, plain and
        corrected; probability of improvement with its interval; effect size.
        """
        return pd.DataFrame(
            {
                **_pair(row, metric, "pairs", "difference", found),
                "p": found["p_value"],
                "p_corrected": found["p_adjusted"],
                "improvement": found["improvement"]["value"],
                "improvement_low": found["improvement"]["low"],
                "improvement_high": found["improvement"]["high"],
                "effect_size": found["effect_size"],
            }
            for row, metric, found in paired(self.summaries, "differences")
        )

    @property
    def interactions(self) -> pd.DataFrame:
        """Differences of differences, a row per metric.

        The controller's change from the usual condition less that of the reference, with its
        interval, or the reason why it has none.
        """
        return pd.DataFrame(
            _pair(row, metric, "episodes", "interaction", found)
            for row, metric, found in paired(self.summaries, "interactions")
        )


def place_of(row: Json) -> Json:
    """Terrain, condition and controller of a row of a summary."""
    return {key: row[key] for key in ("terrain", "condition", "controller")}


def paired(summary: Sequence[Json], key: str) -> Iterator[tuple[Json, str, Json]]:
    """Rows that are compared with the reference, each with every metric and what is found by it.

    Parameters
    ----------
    key
        "differences", or "interactions", which rows under a condition that changes something have.
    """
    for row in summary:
        for metric, found in ((row["paired"] or {}).get(key) or {}).items():
            yield row, metric, found


def _pair(row: Json, metric: str, count: str, name: str, found: Json) -> Json:
    return {
        **place_of(row),
        "reference": row["paired"]["reference"],
        "metric": metric,
        count: found["n"],
        name: found["value"],
        "low": found["low"],
        "high": found["high"],
        "no_interval": found["reason"],
    }


def write_results(results: Results, folder: str | Path) -> Path:
    """Write all files of `results` to `folder`, each whole or not at all; return `results.json`.

    Raises
    ------
    ValueError
        The protocol or a summary holds a number that is not finite.
    OSError
        The folder cannot be written to, or holds such a file that flyrl did not write.
    """
    output = OutputFolder(folder)
    output.check_free(*RESULTS_FILES)
    # results.json takes its place last: whoever reads it finds the other two
    with (
        output.replacing(RESULTS_FILE) as contents,
        output.replacing(TRAJECTORIES_FILE) as trajectories,
        output.replacing(EPISODES_FILE) as episodes,
    ):
        episodes.write_text(csv_table(results.episodes), encoding="utf-8", newline="")
        np.savez_compressed(trajectories, **pack_trajectories(results.trajectories))
        parts = {
            "schema": SCHEMA,
            "files": {
                EPISODES_FILE: file_digest(episodes),
                TRAJECTORIES_FILE: file_digest(trajectories),
            },
            "protocol": results.protocol,
            "drawn": results.drawn,
            "summary": results.summaries,
        }
        with contents.open("w", encoding="utf-8", newline="") as file:
            json.dump(parts, file, indent=1, allow_nan=False)
    return output.path / RESULTS_FILE


def load_results(path: str | Path) -> Results:
    """Read results from their folder, or from their `results.json`.

    Without `trajectories.npz` there are no paths.

    Raises
    ------
    ResultsError
        A file is missing, is not whole, or does not belong to the others.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    file = folder / RESULTS_FILE if path.is_dir() else path
    try:
        contents = json.loads(file.read_text(encoding="utf-8"))
        _check_contents(contents)
        file = folder / EPISODES_FILE
        _check_digest(file, contents)
        episodes = read_episodes(file.read_bytes())
        file = folder / TRAJECTORIES_FILE
        paths: dict[int, Trajectory] = {}
        if file.exists():
            _check_digest(file, contents)
            paths = unpack_trajectories(load_arrays(file))
    except FileNotFoundError:
        raise ResultsError(f"{file}: no such file") from None
    except (KeyError, OverflowError, RecursionError, TypeError, ValueError) as error:
        raise ResultsError(f"{file}: {error}") from error
    return Results(contents["protocol"], episodes, contents["summary"], contents["drawn"], paths)


def _check_contents(contents: Any) -> None:
    """Raise ValueError at the first thing that is not as in `results.json`, naming it."""
    if not isinstance(contents, dict):
        raise ValueError(f"a {type(contents).__name__}; expected an object")
    if contents.get("schema") != SCHEMA:
        raise ValueError(f"schema: {contents.get('schema')!r}; this version reads {SCHEMA!r}")
    _check_keys(contents, _CONTENTS, "results")
    _check_keys(contents["protocol"], _PROTOCOL, "protocol")
    for index, row in enumerate(contents["summary"]):
        _check_keys(row, _SUMMARY, f"summary[{index}]")
        for key in _SUMMARY[str]:
            check_names([row[key]], f"summary[{index}].{key}")


def _check_keys(given: Any, expected: _Keys, where: str) -> None:
    if not isinstance(given, dict):
        raise ValueError(f"{where}: a {type(given).__name__}; expected an object")
    for kind, keys in expected.items():
        for key in keys:
            if key not in given:
                raise ValueError(f"{where}.{key}: missing")
            value, allowed = given[key], (int, float) if kind is float else kind
            # a bool is an int to Python, but no number to us
            if not isinstance(value, allowed) or (isinstance(value, bool) and kind is not object):
                raise ValueError(f"{where}.{key}: {value!r:.60}; expected {kind.__name__}")


def _check_digest(file: Path, contents: Json) -> None:
    digest = file_digest(file)
    if digest is not None and digest != contents["files"].get(file.name):
        raise ValueError(f"it was changed since {RESULTS_FILE} was written, or is of other results")
