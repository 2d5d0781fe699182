"""The table that a sweep ends with: what came of every setting, over its seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from flyrl.cli.sweep import Job, Note, by_key, read_jobs, swept_keys
from flyrl.cli.tables import NOTHING, csv_text, print_table
from flyrl.evaluation.statistics import CONFIDENCE, MIN_RUNS, Interval, mean_over_runs
from flyrl.files import write_text
from flyrl.training.runs import RunSummary, read_run

COMPARISON_FILE: Final = "comparison.csv"

_FIGURES: Final = {
    "final_success": ("last", "success_rate", (0.0, 1.0)),
    "best_success": ("best", "success_rate", (0.0, 1.0)),
    "final_return": ("last", "mean_return", ()),
    "best_return": ("best", "mean_return", ()),
}
"""Column -> which evaluation of a run, which of its figures, and what that lies within."""

Row = dict[str, Any]


def compare_jobs(jobs: Sequence[tuple[Job, RunSummary | None]]) -> list[Row]:
    """A row per combination of swept settings, with its figures over the finished runs.

    Parameters
    ----------
    jobs
        Overrides of each job, and its run where it made one.

    Returns
    -------
    Rows with the swept keys, `jobs`, `runs` (the finished ones, which the figures are over), and
    for each figure its `_mean`, `_low` and `_high`, None where there is none.
    """
    keys = [key for key in swept_keys([job for job, _ in jobs]) if key != "seed"]
    groups: dict[tuple[str | None, ...], list[RunSummary | None]] = {}
    for job, run in jobs:
        settings = by_key(job)
        groups.setdefault(tuple(settings.get(key) for key in keys), []).append(run)
    rows = []
    for values, runs in groups.items():
        finished = {run.path: run for run in runs if run and run.state == "finished"}
        row: Row = dict(zip(keys, values, strict=True))
        row.update(jobs=len(runs), runs=len(finished))
        for column in _FIGURES:
            interval = _figure(column, list(finished.values()))
            row[f"{column}_mean"] = interval.value
            row[f"{column}_low"], row[f"{column}_high"] = interval.low, interval.high
        rows.append(row)
    return rows


def _figure(column: str, runs: Sequence[RunSummary]) -> Interval:
    which, key, limits = _FIGURES[column]
    evaluations: list[Mapping[str, float] | None] = [getattr(run, which) for run in runs]
    return mean_over_runs([row[key] for row in evaluations if row is not None], *limits)


def compare_sweep(folder: Path) -> None:
    """Print the table that compares the runs of a sweep, and write it to `comparison.csv`.

    Raises
    ------
    ValueError
        There is no sweep in the folder.
    OSError
        The folder cannot be written to.
    """
    rows = compare_jobs([(job, _run(folder, note)) for job, note in read_jobs(folder)])
    write_text(folder / COMPARISON_FILE, csv_text(list(rows[0]), rows))
    keys = [key for key in rows[0] if key not in _columns()]
    shown = [
        {
            **{key: row[key] for key in keys},
            "runs": f"{row['runs']} of {row['jobs']}",
            **{column.replace("_", " "): _shown(row, column) for column in _FIGURES},
        }
        for row in rows
    ]
    print_table(list(shown[0]), shown)
    print(
        f"mean over finished runs [{CONFIDENCE:.0%} interval of the mean, Student's t]; fewer than "
        f"{MIN_RUNS} runs, or equal ones, have no interval"
    )


def _columns() -> set[str]:
    ends = ("mean", "low", "high")
    return {"jobs", "runs", *(f"{column}_{end}" for column in _FIGURES for end in ends)}


def _run(folder: Path, note: Note | None) -> RunSummary | None:
    return read_run(folder / note.folder) if note and note.folder else None


def _shown(row: Row, column: str) -> str:
    mean, low, high = (row[f"{column}_{end}"] for end in ("mean", "low", "high"))
    if mean is None:
        return NOTHING
    style = ".1%" if column.endswith("success") else ".2f"
    interval = "" if low is None else f" [{low:{style}}, {high:{style}}]"
    return f"{mean:{style}}{interval}"
