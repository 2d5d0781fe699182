"""Summaries of each controller on each terrain, differences, and who wins by how much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.conditions import compared_conditions
from flyrl.evaluation.metrics import (
    SMALLEST_EFFECTS,
    compared_metrics,
    decisive_metrics,
    lower_is_better,
)
from flyrl.evaluation.rows import metric_columns
from flyrl.evaluation.statistics import (
    MIN_PAIRS,
    Interval,
    adjusted,
    distribution,
    effect_size,
    p_value,
    paired_difference,
    probability_of_improvement,
    success_rate,
)
from flyrl.tasks import OUTCOMES, Task


def summarise(
    rows: pd.DataFrame,
    reference: str,
    horizon_s: float,
    rng: np.random.Generator,
    vary: Mapping[str, Sequence[Any]] | None = None,
    task: Task | None = None,
) -> list[dict[str, Any]]:
    """One summary per terrain, condition and controller, in order of first appearance.

    Where quantities were varied, "paired" holds `interactions` under each condition that changes
    something.

    Parameters
    ----------
    rows
        Episodes; see `flyrl.evaluation.rows`.
    reference
        Name of the controller that the others are compared with.
    horizon_s
        Time limit of an episode, s: the time to goal of an episode without success, in pairs only.
    rng
        Source of the resampling.
    vary
        Quantities that were varied, and their values.
    task
        Says what to compare by; None: the built-in task that the rows name.

    Raises
    ------
    ValueError
        If `reference` has no episodes, or a controller walked one episode twice.
    """
    place = ["terrain", "condition"]
    twice = rows[rows.duplicated([*place, "controller", "episode"])]
    if len(twice):
        first = twice.iloc[0]
        raise ValueError(
            f"episodes must be walked once, got {first['episode']} twice by "
            f"{first['controller']} on {first['terrain']}"
        )
    names = list(rows["controller"].unique())
    if reference not in names:
        raise ValueError(f"reference must be one of {', '.join(names)}, got {reference!r}")
    compared = compared_metrics(task or rows["task"].iloc[0])
    decisive = decisive_metrics(task or rows["task"].iloc[0])
    summary = []
    for _, walked in rows.groupby(place, sort=False, observed=True):
        others = walked[walked["controller"] == reference]
        for name in names:
            own = walked[walked["controller"] == name]
            if own.empty:
                continue
            row = summarise_controller(own)
            if name != reference:
                row["paired"] = {
                    "reference": reference,
                    "differences": paired_differences(own, others, compared, horizon_s, rng),
                }
            summary.append(row)
    _adjust(summary)
    usual, *changed = (condition.label for condition in compared_conditions(vary or {}))
    for row in summary:
        if row["paired"] and row["condition"] in changed:
            walked = rows[rows["terrain"] == row["terrain"]]
            row["paired"]["interactions"] = interactions(
                walked[walked["condition"] == row["condition"]],
                walked[walked["condition"] == usual],
                (row["controller"], reference),
                decisive,
                horizon_s,
                rng,
            )
    return summary


def _adjust(summary: Sequence[dict[str, Any]]) -> None:
    """Correct the p-values; all comparisons by one metric are a family."""
    paired = [row["paired"]["differences"] for row in summary if row["paired"]]
    for metric in paired[0] if paired else ():
        family = [differences[metric] for differences in paired]
        corrected = adjusted([entry["p_value"] for entry in family])
        for entry, value in zip(family, corrected, strict=True):
            entry["p_adjusted"] = value


def summarise_controller(rows: pd.DataFrame) -> dict[str, Any]:
    """Summary of one controller on one terrain, from its `rows`; "paired" is None."""
    outcomes = Counter(rows["outcome"])
    kinds = dict.fromkeys((*OUTCOMES[1:], *sorted(outcomes)))
    first = rows.iloc[0]
    return {
        **{key: first[key] for key in ("controller", "task", "terrain", "condition")},
        "episodes": len(rows),
        "successes": outcomes["success"],
        "outcomes": {outcome: outcomes[outcome] for outcome in kinds},
        "success_rate": asdict(success_rate(outcomes["success"], len(rows))),
        "metrics": {key: asdict(distribution(rows[key])) for key in metric_columns(rows)},
        "paired": None,
    }


def paired_differences(
    own: pd.DataFrame,
    others: pd.DataFrame,
    compared: Sequence[str],
    horizon_s: float,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Mean differences own - other, one per metric in `compared`.

    Each with its interval, `p_value`, `effect_size`, and `improvement`: the share of episodes in
    which own is the better one.
    """
    found = {}
    for metric in compared:
        differences = paired_values(own, others, metric, horizon_s)
        gains = -differences if lower_is_better(metric) else differences
        found[metric] = {
            **asdict(paired_difference(differences, rng)),
            "p_value": p_value(differences, rng),
            "effect_size": effect_size(differences),
            "improvement": asdict(probability_of_improvement(gains, rng)),
        }
    return found


def interactions(
    changed: pd.DataFrame,
    usual: pd.DataFrame,
    names: tuple[str, str],
    decisive: Sequence[str],
    horizon_s: float,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Mean differences of differences with their intervals, by decisive metric of the task.

    (own under the condition - own usually) - (other under the condition - other usually), over
    the episodes that both walked under both.

    Parameters
    ----------
    changed, usual
        Rows on one terrain under the condition and under the usual one.
    names
        The controller and the one that it is compared with.
    decisive
        These metrics.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    rng
        Source of the resampling.
    """

    def change(name: str, metric: str) -> pd.Series[float]:
        after, before = (
            metric_values(rows[rows["controller"] == name], metric, horizon_s)
            for rows in (changed, usual)
        )
        return after - before  # by episode; NaN of one that was walked once

    own, other = names
    return {
        metric: asdict(
            paired_difference((change(own, metric) - change(other, metric)).dropna(), rng)
        )
        for metric in decisive
    }


def paired_values(
    own: pd.DataFrame, others: pd.DataFrame, metric: str, horizon_s: float
) -> NDArray[np.float64]:
    """Differences own - other of `metric` over the episodes that both walked, in own's order.

    An episode without success counts its full horizon as time to goal, so that every pair counts.

    Parameters
    ----------
    own, others
        Rows of two controllers.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    """
    one, other = (metric_values(rows, metric, horizon_s) for rows in (own, others))
    one = one[one.index.isin(other.index)]
    return np.asarray(one - other.loc[one.index], dtype=np.float64)


def metric_values(rows: pd.DataFrame, metric: str, horizon_s: float) -> pd.Series[float]:
    """What controllers are compared by, by episode: see `paired_values`."""
    column = rows.set_index("episode")[metric].astype(np.float64)
    return column.fillna(horizon_s) if metric == "time_to_goal_s" else column


@dataclass(frozen=True)
class Leader:
    """Who is best on a terrain under a condition.

    Attributes
    ----------
    terrain
        Where.
    names
        The best; more than one if nothing separates them, best mean first.
    metric
        The metric that separated the best from the next, or the task's first if none did.
    value
        The best's mean of it.
    next_name, next_value
        Who comes next, and its mean; None where all are the best.
    difference
        The best minus the next on the same episodes, with its interval; None without a next.
    condition
        Label of the condition; empty where nothing is varied.
    """

    terrain: str
    names: tuple[str, ...]
    metric: str
    value: float
    next_name: str | None = None
    next_value: float | None = None
    difference: Interval | None = None
    condition: str = ""

    @property
    def is_alone(self) -> bool:
        """Whether one is better than all others."""
        return len(self.names) == 1


def find_leaders(
    rows: pd.DataFrame,
    horizon_s: float,
    rng: np.random.Generator,
    effects: Mapping[str, float] = SMALLEST_EFFECTS,
    decisive: Sequence[str] = (),
) -> list[Leader]:
    """The best on each terrain under each condition, in order of first appearance.

    They are ranked by what the task is about (see `decisive_metrics`). Those who are not worse than
    the best (the interval of the mean difference includes 0, the difference is smaller than the
    smallest effect of interest, or there are too few pairs) are ranked by the next metric.

    Parameters
    ----------
    rows
        Episodes; see `flyrl.evaluation.rows`.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    rng
        Source of the resampling.
    effects
        Smallest effect of interest by metric; 0 of others.
    decisive
        The `decisive_metrics` of the task; none: of the built-in one that the rows name.
    """
    return [
        replace(
            _leader(
                str(terrain),
                {
                    str(name): own
                    for name, own in walked.groupby("controller", sort=False, observed=True)
                },
                decisive or decisive_metrics(walked["task"].iloc[0]),
                horizon_s,
                rng,
                effects,
            ),
            condition=str(condition),
        )
        for (terrain, condition), walked in rows.groupby(
            ["terrain", "condition"], sort=False, observed=True
        )
    ]


def _leader(
    terrain: str,
    own: Mapping[str, pd.DataFrame],
    metrics: Sequence[str],
    horizon_s: float,
    rng: np.random.Generator,
    effects: Mapping[str, float],
) -> Leader:
    """The best of some controllers, by the first of some metrics that tells them apart."""
    metric, *finer = metrics
    means = {name: metric_values(rows, metric, horizon_s).mean() for name, rows in own.items()}
    best, *others = sorted(
        own, key=lambda name: means[name] * (1 if lower_is_better(metric) else -1)
    )
    differences = {
        name: paired_difference(paired_values(own[best], own[name], metric, horizon_s), rng)
        for name in others
    }
    behind = [name for name in others if _is_clear(differences[name], effects.get(metric, 0.0))]
    level = [best, *(name for name in others if name not in behind)]
    if finer and len(level) > 1:
        leader = _leader(
            terrain, {name: own[name] for name in level}, finer, horizon_s, rng, effects
        )
        if len(leader.names) < len(level):
            return leader
    value = float(means[best])
    if not behind:
        return Leader(terrain, tuple(level), metric, value)
    runner_up = behind[0]
    return Leader(
        terrain,
        tuple(level),
        metric,
        value,
        runner_up,
        float(means[runner_up]),
        differences[runner_up],
    )


def _is_clear(difference: Interval, effect: float) -> bool:
    """Whether a difference is at least `effect`, and its interval leaves out 0 or is a point."""
    if abs(difference.value or 0.0) < effect:
        return False
    if difference.low is None or difference.high is None:
        return difference.n >= MIN_PAIRS and bool(difference.value)
    return difference.low > 0 or difference.high < 0
