"""What an evaluation comes to: a summary of each controller on each terrain, and differences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from flyrl.evaluation.metrics import LOWER_IS_BETTER, METRICS, compared_metrics
from flyrl.evaluation.statistics import (
    adjusted,
    distribution,
    effect_size,
    p_value,
    paired_difference,
    probability_of_improvement,
    success_rate,
)
from flyrl.rollouts.records import OUTCOMES

Row = Mapping[str, Any]


def summarise(
    rows: Sequence[Row], reference: str, horizon_s: float, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """One summary per terrain, condition and controller, in order of first appearance.

    Parameters
    ----------
    rows
        Episodes as in `results.json`.
    reference
        Name of the controller that the others are compared with.
    horizon_s
        Time limit of an episode, s: the time to goal of an episode without success, in pairs only.
    rng
        Source of the resampling.

    Raises
    ------
    ValueError
        If `reference` has no episodes, or a controller walked one episode twice.
    """
    groups: dict[tuple[str, str], dict[str, dict[int, Row]]] = {}
    for row in rows:
        walked = groups.setdefault((row["terrain"], row["condition"]), {})
        episodes = walked.setdefault(row["controller"], {})
        if row["episode"] in episodes:
            raise ValueError(
                f"episodes must be walked once, got {row['episode']} twice by {row['controller']} "
                f"on {row['terrain']}"
            )
        episodes[row["episode"]] = row
    names = list(dict.fromkeys(row["controller"] for row in rows))
    if reference not in names:
        raise ValueError(f"reference must be one of {', '.join(names)}, got {reference!r}")
    summary = []
    for walked in groups.values():
        others = walked.get(reference, {})
        for name in names:
            if own := walked.get(name):
                row = summarise_controller(list(own.values()))
                if name != reference:
                    row["paired"] = {
                        "reference": reference,
                        "differences": paired_differences(own, others, horizon_s, rng),
                    }
                summary.append(row)
    _adjust(summary)
    return summary


def _adjust(summary: Sequence[dict[str, Any]]) -> None:
    """Correct the p-values; all comparisons by one metric are a family."""
    paired = [row["paired"]["differences"] for row in summary if row["paired"]]
    for metric in paired[0] if paired else ():
        family = [differences[metric] for differences in paired]
        corrected = adjusted([entry["p_value"] for entry in family])
        for entry, value in zip(family, corrected, strict=True):
            entry["p_adjusted"] = value


def summarise_controller(rows: Sequence[Row]) -> dict[str, Any]:
    """Summary of one controller on one terrain, from its `rows`; "paired" is None."""
    outcomes = Counter(row["outcome"] for row in rows)
    kinds = dict.fromkeys((*OUTCOMES, *sorted(outcomes)))
    return {
        "controller": rows[0]["controller"],
        "task": rows[0]["task"],
        "terrain": rows[0]["terrain"],
        "condition": rows[0]["condition"],
        "episodes": len(rows),
        "successes": outcomes["success"],
        "outcomes": {outcome: outcomes[outcome] for outcome in kinds},
        "success_rate": asdict(success_rate(outcomes["success"], len(rows))),
        "metrics": {key: asdict(distribution([row[key] for row in rows])) for key in METRICS},
        "paired": None,
    }


def paired_differences(
    own: Mapping[int, Row], others: Mapping[int, Row], horizon_s: float, rng: np.random.Generator
) -> dict[str, Any]:
    """Mean differences own - other, one per metric that the task is compared by.

    Each with its interval, `p_value`, `effect_size`, and `improvement`: the share of episodes in
    which own is the better one.
    """
    task = next(iter(own.values()))["task"]
    found = {}
    for metric in compared_metrics(task):
        differences = paired_values(own, others, metric, horizon_s)
        gains = -np.array(differences) if metric in LOWER_IS_BETTER else differences
        found[metric] = {
            **asdict(paired_difference(differences, rng)),
            "p_value": p_value(differences, rng),
            "effect_size": effect_size(differences),
            "improvement": asdict(probability_of_improvement(gains, rng)),
        }
    return found


def paired_values(
    own: Mapping[int, Row], others: Mapping[int, Row], metric: str, horizon_s: float
) -> list[float]:
    """Differences own - other of `metric` over the episodes that both walked.

    An episode without success counts its full horizon as time to goal, so that every pair counts.

    Parameters
    ----------
    own, others
        Rows of two controllers, keyed by episode index.
    horizon_s
        Stands in for the time to goal of an episode without success, s.
    """

    def value(row: Row) -> float:
        given = row[metric]
        return horizon_s if metric == "time_to_goal_s" and given is None else float(given)

    return [value(row) - value(others[index]) for index, row in own.items() if index in others]
