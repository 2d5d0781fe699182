"""Who wins where, by how much, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from flyrl.evaluation.metrics import SMALLEST_EFFECTS, decisive_metrics, lower_is_better
from flyrl.evaluation.statistics import MIN_PAIRS, Interval, paired_difference
from flyrl.evaluation.summary import metric_values, paired_values


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
