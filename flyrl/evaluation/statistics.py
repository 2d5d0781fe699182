"""Statistics over episodes: medians, success rates, and paired differences with intervals.

Nothing is claimed from too little: without at least `MIN_PAIRS` pairs (`MIN_RUNS` runs), or without
any spread, a difference (a mean over runs) has no interval, and says why.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from flyrl.evaluation.metrics import METRICS, compared_metrics
from flyrl.rollouts.records import OUTCOMES

CONFIDENCE: Final = 0.95
MIN_PAIRS: Final = 5
MIN_RUNS: Final = 5
RESAMPLES: Final = 9999

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Interval:
    """A point estimate with its confidence interval.

    `low` and `high` are None where no interval can be given; `reason` then says why.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int
    reason: str | None = None


@dataclass(frozen=True)
class Distribution:
    """Centre and spread of one metric over the `n` episodes that have it."""

    n: int
    median: float | None
    mean: float | None
    q1: float | None
    q3: float | None


def success_rate(successes: int, n: int) -> Interval:
    """Success rate with its score interval (Wilson 1927, doi 10.1080/01621459.1927.10502953)."""
    if not 0 <= successes <= n:
        raise ValueError(f"successes must lie within 0 and n = {n}, got {successes}")
    if n == 0:
        return Interval(None, None, None, 0, "no episodes")
    bounds = stats.binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / n, float(bounds.low), float(bounds.high), n)


def distribution(values: Sequence[float | None]) -> Distribution:
    """Median, mean and quartiles of the values that are not None."""
    present = np.array([value for value in values if value is not None], dtype=np.float64)
    if present.size == 0:
        return Distribution(0, None, None, None, None)
    q1, median, q3 = np.quantile(present, (0.25, 0.5, 0.75))
    return Distribution(present.size, float(median), float(present.mean()), float(q1), float(q3))


def paired_difference(differences: ArrayLike, rng: np.random.Generator) -> Interval:
    """Mean of paired differences with its bootstrap BCa interval.

    Parameters
    ----------
    differences
        One difference per pair, shape (n,).
    rng
        Source of the resampling.

    Notes
    -----
    Efron 1987, doi 10.1080/01621459.1987.10478410, by `scipy.stats.bootstrap`.
    """
    values = np.asarray(differences, dtype=np.float64)
    n = values.size
    if n == 0:
        return Interval(None, None, None, 0, "no pairs")
    mean = float(values.mean())
    if n < MIN_PAIRS:
        return Interval(mean, None, None, n, f"{n} pairs: an interval needs at least {MIN_PAIRS}")
    if np.ptp(values) == 0:
        return Interval(mean, None, None, n, f"all {n} differences are equal: nothing to resample")
    with warnings.catch_warnings():
        # Reported below as a missing interval instead.
        warnings.simplefilter("ignore")
        bounds = stats.bootstrap(
            (values,),
            np.mean,
            n_resamples=RESAMPLES,
            batch=max(1, 1_000_000 // n),
            confidence_level=CONFIDENCE,
            method="BCa",
            rng=rng,
        ).confidence_interval
    low, high = float(bounds.low), float(bounds.high)
    if not (math.isfinite(low) and math.isfinite(high)):
        return Interval(mean, None, None, n, "the differences are too alike to resample")
    return Interval(mean, low, high, n)


def mean_over_runs(values: ArrayLike, low: float = -math.inf, high: float = math.inf) -> Interval:
    """Mean over runs that differ in their seed, with Student's t interval.

    The resampling of `paired_difference` is too narrow for the five or ten runs that one can
    afford.

    Parameters
    ----------
    values
        One per run, shape (n,).
    low, high
        What the values lie within; the interval is cut there.
    """
    array = np.asarray(values, dtype=np.float64)
    n = array.size
    if n == 0:
        return Interval(None, None, None, 0, "no runs")
    mean = float(array.mean())
    if n < MIN_RUNS:
        return Interval(mean, None, None, n, f"{n} runs: an interval needs at least {MIN_RUNS}")
    if np.ptp(array) == 0:
        return Interval(mean, None, None, n, f"all {n} values are equal")
    bounds = stats.ttest_1samp(array, 0.0).confidence_interval(CONFIDENCE)
    return Interval(mean, max(low, float(bounds.low)), min(high, float(bounds.high)), n)


def summarise(
    rows: Sequence[Row], reference: str, horizon_s: float, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """One summary per terrain and controller, in order of first appearance.

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
    groups: dict[tuple[str, str], dict[int, Row]] = {}
    for row in rows:
        episodes = groups.setdefault((row["terrain"], row["controller"]), {})
        if row["episode"] in episodes:
            raise ValueError(
                f"episodes must be walked once, got {row['episode']} twice by {row['controller']} "
                f"on {row['terrain']}"
            )
        episodes[row["episode"]] = row
    names = list(dict.fromkeys(name for _, name in groups))
    if reference not in names:
        raise ValueError(f"reference must be one of {', '.join(names)}, got {reference!r}")
    terrains = list(dict.fromkeys(terrain for terrain, _ in groups))
    summary = []
    for terrain in terrains:
        others = groups.get((terrain, reference), {})
        for name in names:
            if own := groups.get((terrain, name)):
                row = summarise_controller(list(own.values()))
                if name != reference:
                    row["paired"] = {
                        "reference": reference,
                        "differences": paired_differences(own, others, horizon_s, rng),
                    }
                summary.append(row)
    return summary


def summarise_controller(rows: Sequence[Row]) -> dict[str, Any]:
    """Summary of one controller on one terrain, from its `rows`; "paired" is None."""
    outcomes = Counter(row["outcome"] for row in rows)
    kinds = dict.fromkeys((*OUTCOMES, *sorted(outcomes)))
    return {
        "controller": rows[0]["controller"],
        "task": rows[0]["task"],
        "terrain": rows[0]["terrain"],
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
    """Mean differences own - other with intervals, one per metric that the task is compared by."""
    task = next(iter(own.values()))["task"]
    return {
        metric: asdict(paired_difference(paired_values(own, others, metric, horizon_s), rng))
        for metric in compared_metrics(task)
    }


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
