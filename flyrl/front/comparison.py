"""Runs of sweeps: compared over their seeds in a table and a figure, and known again."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pandas as pd

from flyrl.evaluation.metrics import decisive_metrics, metric_named
from flyrl.evaluation.statistics import CONFIDENCE, MIN_RUNS, mean_over_runs
from flyrl.files import write_text
from flyrl.report import write_learning_curves
from flyrl.text import csv_text, printable
from flyrl.training.config import WITHOUT_EFFECT, TrainingConfig, training_record
from flyrl.training.runs import RunSummary, find_runs, flat, names_of, read_run

COMPARISON_FILE: Final = "comparison.csv"
NOTHING: Final = "-"

Figure = tuple[str, str, tuple[float, ...]]
"""Which evaluation of a run, which of its columns, and what that lies within."""

Row = dict[str, Any]
Settings = Mapping[str, Any]


@dataclass(frozen=True)
class Group:
    """Runs that differ in nothing but their seed.

    Attributes
    ----------
    settings
        What sets the group apart from the others; the same keys in each.
    jobs
        How many were found.
    runs
        The finished ones.
    """

    settings: Settings
    jobs: int
    runs: tuple[RunSummary, ...]


def group_runs(runs: Sequence[RunSummary]) -> list[Group]:
    """A group per combination of the settings in which runs differ, but for the seed.

    Settings without an effect on the result set nothing apart, and of runs that are the same but
    for these, one counts. What follows from the task, terrain, algorithm, body or leg controller
    (the learning rate that is SAC's default, say) is not named beside it.
    """
    runs = sorted(runs, key=lambda run: run.state != "finished")
    settings = [_settings(run) for run in runs]
    table = pd.DataFrame([{key: repr(value) for key, value in own.items()} for own in settings])
    table = table.fillna(repr(None)).drop_duplicates()
    keys = [key for key in map(str, table) if key != "seed" and _differs(table, key)]
    groups: dict[tuple[str, ...], list[int]] = {}
    for row in table.index:
        groups.setdefault(tuple(table.loc[row, keys]), []).append(row)
    return [
        Group(
            {key: settings[rows[0]].get(key) for key in keys},
            len(rows),
            tuple(runs[row] for row in rows if runs[row].state == "finished"),
        )
        for rows in groups.values()
    ]


def _differs(table: pd.DataFrame, key: str) -> bool:
    """Whether a column has several values, also where the section of its key has the same name."""
    section = key.partition(".")[0]
    is_within = section != key and section in table
    same = table[section] if is_within else pd.Series("", table.index)
    return bool((table[key].groupby(same).nunique() > 1).any())


def _settings(run: RunSummary) -> Settings:
    """Dotted settings that have an effect: names first, `algo.name` as `algo`."""
    names = names_of(run)
    dotted = {key.removesuffix(".name"): value for key, value in flat(run.settings).items()}
    settings = {**names, **dotted, **names}
    return with_effect(settings)


def with_effect(settings: Settings, but: Sequence[str] = ()) -> Settings:
    """Dotted settings that affect the result of a run, and those in `but`."""
    return {
        key: value
        for key, value in flat(settings).items()
        if not key.startswith(WITHOUT_EFFECT) or f"{key}.".startswith(tuple(f"{k}." for k in but))
    }


def figures_of(groups: Sequence[Group]) -> dict[str, Figure]:
    """Figures that groups are compared by.

    Success, what decides the task as far as the evaluations have it, and the return; of runs whose
    rewards differ, the unweighted reward terms instead of the return.
    """
    runs = [run for group in groups for run in group.runs]
    columns = dict.fromkeys(key for run in runs for key in run.last or ())
    figures: dict[str, Figure] = {
        "final_success": ("last", "success_rate", (0.0, 1.0)),
        "best_success": ("best", "success_rate", (0.0, 1.0)),
    }
    shown = [key for key in _decisive(groups) if key in columns]
    if has_one_reward(groups):
        figures |= {"final_return": ("last", "mean_return", ())}
        figures |= {"best_return": ("best", "mean_return", ())}
    else:
        shown += [key for key in columns if key.startswith("unweighted_")]
    return figures | {f"final_{key}": ("last", key, ()) for key in shown}


def has_one_reward(groups: Sequence[Group]) -> bool:
    """Whether returns can be compared: all finished runs have the same task, terms and weights."""
    parts = ("task.name", "task.terms", "task.without", "task.weights")
    rewards = {repr([run.setting(key) for key in parts]) for g in groups for run in g.runs}
    return len(rewards) < 2


def _decisive(groups: Sequence[Group]) -> tuple[str, ...]:
    """Decisive metrics of the task of all finished runs; none if they have several."""
    found = {_decisive_of(run) for group in groups for run in group.runs}
    return found.pop() if len(found) == 1 else ()


def _decisive_of(run: RunSummary) -> tuple[str, ...]:
    """Decisive metrics of a run's task; where none are noted, the task is a built-in one."""
    noted = run.provenance.get("decisive")
    if isinstance(noted, list):
        return tuple(map(str, noted))
    return decisive_metrics(str(run.setting("task.name")))


def ranking_metrics(groups: Sequence[Group]) -> list[str]:
    """Metrics to rank by: the task's decisive ones, success, and the return if comparable."""
    figures = figures_of(groups)
    metrics = dict.fromkeys((*_decisive(groups), "success", "return"))
    return [metric for metric in metrics if f"final_{metric}" in figures]


def ranked(groups: Sequence[Group]) -> list[tuple[Group, Row]]:
    """Groups from the best to the worst, by the means of their final evaluations.

    Groups without a finished run come last.

    Returns
    -------
    Each with its row of the table: the settings, `jobs`, `runs` (the finished ones, which the
    figures are over), and for each figure its `_mean`, `_low` and `_high`, None where there is
    none.
    """
    figures, metrics = figures_of(groups), ranking_metrics(groups)
    table: list[tuple[Group, Row]] = []
    for group in groups:
        row: Row = {**group.settings, "jobs": group.jobs, "runs": len(group.runs)}
        for column, (which, key, limits) in figures.items():
            evaluations = [getattr(run, which) or {} for run in group.runs]
            values = [each[key] for each in evaluations if key in each]
            interval = mean_over_runs(values, *limits)
            row[f"{column}_mean"] = interval.value
            row[f"{column}_low"], row[f"{column}_high"] = interval.low, interval.high
        table.append((group, row))

    def rank(line: tuple[Group, Row]) -> list[tuple[bool, float]]:
        means = {metric: line[1][f"final_{metric}_mean"] for metric in metrics}
        return [
            (mean is None, (mean or 0.0) * (1 if metric_named(metric).lower_is_better else -1))
            for metric, mean in means.items()
        ]

    return sorted(table, key=rank)


def earlier_run(config: TrainingConfig, folder: Path, but: Sequence[str] = ()) -> RunSummary | None:
    """Find the finished or interrupted run in a folder with the settings of a config.

    Parameters
    ----------
    config
        Of a training. Of its settings without an effect on the result, only `but` count.
    folder
        Of a sweep.
    but
        Dotted keys.

    Raises
    ------
    ValueError
        Another process is at it.
    """
    wanted = with_effect(training_record(config), but)
    found: RunSummary | None = None
    for path in find_runs(folder):
        run = read_run(path)
        if with_effect(run.settings, but) != wanted:
            continue
        if run.state == "finished":
            return run
        if run.state == "running":
            raise ValueError(f"another process trains in {path}")
        if run.state == "interrupted" and run.has_checkpoint:
            found = found or run
    return found


def compare_folders(folders: Sequence[Path], output: Path) -> tuple[list[Row], list[str]]:
    """Compare all runs in some folders, which may be of sweeps or of single runs, as of one sweep.

    Returns
    -------
    Rows and notes of `write_comparison`.

    Raises
    ------
    ValueError
        A folder does not exist, or holds no run.
    OSError
        A folder cannot be read, or `output` cannot be written to.
    """
    found: dict[Path, RunSummary] = {}
    for folder in folders:
        paths = find_runs(folder) if folder.is_dir() else []
        if not paths:
            raise ValueError(f"there is no run in {folder}")
        found.update({path.resolve(): read_run(path) for path in paths})
    for run in found.values():
        if not run.settings:
            print(f"left out: {run.path}: {'; '.join(run.problems)}", file=sys.stderr)
    readable = [run for run in found.values() if run.settings]
    if not readable:
        raise ValueError("there are no settings of any run to compare")
    return write_comparison(group_runs(readable), output)


def write_comparison(groups: Sequence[Group], output: Path) -> tuple[list[Row], list[str]]:
    """Write table and learning curves of groups to a folder.

    Returns
    -------
    A row per group for people, the best first: the settings that tell it apart, and its values as
    text; and lines that say how to read them.
    """
    best_first = ranked(groups)
    groups, rows = [group for group, _ in best_first], [row for _, row in best_first]
    figures = figures_of(groups)
    output.mkdir(parents=True, exist_ok=True)
    write_text(output / COMPARISON_FILE, csv_text(list(rows[0]), rows))
    keys = telling_keys(groups)
    labels = [label(group, keys) for group in groups]
    evaluations = [[run.evaluations for run in group.runs] for group in groups]
    curves = list(zip(labels, evaluations, strict=True))
    title = _in_common(groups) if keys else ""
    lower = "mean_return" if has_one_reward(groups) else "mean_duration_s"
    write_learning_curves(output, curves, title, lower)
    shown = [
        {
            **{key: row[key] for key in keys},
            "runs": f"{row['runs']} of {row['jobs']}",
            **{column.replace("_", " "): _shown(row, column) for column in figures},
        }
        for row in rows
    ]
    notes = [
        f"mean over finished runs [{CONFIDENCE:.0%} interval of the mean, Student's t]; fewer than "
        f"{MIN_RUNS} runs, or equal ones, have no interval",
        f"best first, by the final {', '.join(ranking_metrics(groups))}",
    ]
    if not has_one_reward(groups):
        notes.append("their rewards differ, so returns are not compared")
    if others := [key for key in groups[0].settings if key not in keys]:
        notes.append(f"they differ also in {', '.join(others)}: see {output / COMPARISON_FILE}")
    return shown, list(map(printable, notes))


def telling_keys(groups: Sequence[Group]) -> list[str]:
    """The first of the settings that are enough to tell the groups apart."""
    keys: list[str] = []
    most = 1
    for key in groups[0].settings:
        apart = {repr([group.settings[k] for k in (*keys, key)]) for group in groups}
        if len(apart) > most:
            keys, most = [*keys, key], len(apart)
    return keys


def label(group: Group, keys: Sequence[str]) -> str:
    """Some settings of a group; without any, what its runs have learnt."""
    values = {key: group.settings[key] for key in keys}
    text = " ".join(f"{key}={NOTHING if v is None else v}" for key, v in values.items())
    return printable(text or _in_common([group]))


def _in_common(groups: Sequence[Group]) -> str:
    """Task, terrain and algorithm, as far as all finished runs have the same."""
    names = [names_of(run) for group in groups for run in group.runs]
    values = [{own[key] for own in names} for key in (names[0] if names else ())]
    return printable(" ".join(value.pop() for value in values if len(value) == 1))


def _shown(row: Row, column: str) -> str:
    mean, low, high = (row[f"{column}_{end}"] for end in ("mean", "low", "high"))
    if mean is None:
        return NOTHING
    style = ".1%" if column.endswith("success") else ".2f"
    interval = "" if low is None else f" [{low:{style}}, {high:{style}}]"
    return f"{mean:{style}}{interval}"
