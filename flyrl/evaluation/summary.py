"""What an evaluation comes to: a summary of each controller on each terrain, and differences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.evaluation.conditions import compared_conditions
from flyrl.evaluation.metrics import compared_metrics, decisive_metrics, lower_is_better
from flyrl.evaluation.rows import metric_columns
from flyrl.evaluation.statistics import (
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
