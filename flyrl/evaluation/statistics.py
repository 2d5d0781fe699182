"""Statistics over episodes and runs: rates, differences, how sure they are, and how large.

Nothing is claimed from too little: without at least `MIN_PAIRS` pairs (`MIN_RUNS` runs), or without
any spread, a difference (a mean over runs) has no interval, and says why.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import scipy  # whose `stats` takes a second to import: it is loaded where it is used
from numpy.typing import ArrayLike, NDArray

CONFIDENCE: Final = 0.95
MIN_PAIRS: Final = 5
MIN_RUNS: Final = 5
RESAMPLES: Final = 9999
MANY_PAIRS: Final = 2000
"""Beyond so many pairs Student's t stands in for resampling, which would say the same, slowly."""


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
    if n == 0:
        return Interval(None, None, None, 0, "no episodes")
    bounds = scipy.stats.binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / n, float(bounds.low), float(bounds.high), n)


def distribution(values: ArrayLike) -> Distribution:
    """Median, mean and quartiles of the values that are not None or NaN."""
    given = np.asarray(values, dtype=np.float64)
    present = given[~np.isnan(given)]
    if present.size == 0:
        return Distribution(0, None, None, None, None)
    q1, median, q3 = np.quantile(present, (0.25, 0.5, 0.75))
    return Distribution(present.size, float(median), float(present.mean()), float(q1), float(q3))


def paired_difference(differences: ArrayLike, rng: np.random.Generator) -> Interval:
    """Mean of paired differences with its bootstrap BCa interval; t beyond `MANY_PAIRS`.

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
    mean = _mean(values, MIN_PAIRS, "pairs", "differences are equal: nothing to resample")
    if mean.reason:
        return mean
    n = values.size
    if n > MANY_PAIRS:
        low, high = _students(values)
        return replace(mean, low=low, high=high)
    with warnings.catch_warnings():
        # Reported below as a missing interval instead.
        warnings.simplefilter("ignore")
        bounds = scipy.stats.bootstrap(
            (values,),
            np.mean,
            n_resamples=RESAMPLES,
            batch=_batch(n),
            confidence_level=CONFIDENCE,
            method="BCa",
            rng=rng,
        ).confidence_interval
    low, high = float(bounds.low), float(bounds.high)
    if not (math.isfinite(low) and math.isfinite(high)):
        return replace(mean, reason="the differences are too alike to resample")
    return replace(mean, low=low, high=high)


def _mean(values: NDArray[np.float64], least: int, things: str, equal: str) -> Interval:
    """Mean of values without an interval yet, or with the reason why it can have none."""
    n = values.size
    if n == 0:
        return Interval(None, None, None, 0, f"no {things}")
    reason = None
    if n < least:
        reason = f"{n} {things}: an interval needs at least {least}"
    elif np.ptp(values) == 0:
        reason = f"all {n} {equal}"
    return Interval(float(values.mean()), None, None, n, reason)


def _students(values: NDArray[np.float64]) -> tuple[float, float]:
    """Bounds of Student's t interval."""
    bounds = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    return float(bounds.low), float(bounds.high)


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
    mean = _mean(array, MIN_RUNS, "runs", "values are equal")
    if mean.reason:
        return mean
    lower, upper = _students(array)
    return replace(mean, low=max(low, lower), high=min(high, upper))


def p_value(differences: ArrayLike, rng: np.random.Generator) -> float | None:
    """p-value of the sign-flip test of paired differences; None of too few.

    All signs are tried where there are no more than `RESAMPLES` ways, else as many are drawn; of
    more than `MANY_PAIRS` it is that of Student's t.

    Parameters
    ----------
    differences
        One per pair, shape (n,).
    rng
        Source of the signs.

    Notes
    -----
    Fisher 1935, The Design of Experiments; by `scipy.stats.permutation_test`.
    """
    values = np.asarray(differences, dtype=np.float64)
    if values.size < MIN_PAIRS:
        return None
    if values.size > MANY_PAIRS:
        if not values.any():
            return 1.0
        with warnings.catch_warnings():
            # that all differ by the same is no accident
            warnings.simplefilter("ignore")
            return float(scipy.stats.ttest_1samp(values, 0.0).pvalue)
    test = scipy.stats.permutation_test(
        (values,),
        np.mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=RESAMPLES,
        batch=_batch(values.size),
        rng=rng,
    )
    return float(test.pvalue)


def adjusted(p_values: Sequence[float | None]) -> list[float | None]:
    """p-values of a family of comparisons, corrected for there being so many of them.

    Controls the false discovery rate at 5 % for adjusted p < 0.05.

    Notes
    -----
    Benjamini & Hochberg 1995, doi 10.1111/j.2517-6161.1995.tb02031.x.
    """
    given = [p for p in p_values if p is not None]
    corrected = iter(scipy.stats.false_discovery_control(given) if given else ())
    return [None if p is None else float(next(corrected)) for p in p_values]


def probability_of_improvement(gains: ArrayLike, rng: np.random.Generator) -> Interval:
    """Share of pairs with a gain above 0, ties counting half, with its bootstrap BCa interval."""
    return paired_difference((np.sign(np.asarray(gains, dtype=np.float64)) + 1) / 2, rng)


def effect_size(differences: ArrayLike) -> float | None:
    """Mean of paired differences in their standard deviations; None of too few, or of equal ones.

    Notes
    -----
    d_z of Lakens 2013, doi 10.3389/fpsyg.2013.00863.
    """
    values = np.asarray(differences, dtype=np.float64)
    if values.size < MIN_PAIRS or np.ptp(values) == 0:
        return None
    return float(values.mean() / values.std(ddof=1))


def interquartile_mean(scores: ArrayLike, rng: np.random.Generator) -> Interval:
    """Mean of the middle half of all scores, with its stratified bootstrap interval.

    Parameters
    ----------
    scores
        One per run and place (a terrain, say), shape (runs, places); runs are resampled within each
        place.
    rng
        Source of the resampling.

    Notes
    -----
    Agarwal et al. 2021, https://arxiv.org/abs/2108.13264.
    """
    return _over_runs(scores, lambda values: scipy.stats.trim_mean(values, 0.25, axis=-1), rng)


def performance_profile(
    scores: ArrayLike, thresholds: ArrayLike, rng: np.random.Generator
) -> list[Interval]:
    """Share of all scores at or above each threshold, with its stratified bootstrap interval.

    Parameters
    ----------
    scores, rng
        As in `interquartile_mean`.
    thresholds
        Shape (k,).
    """
    return [
        _over_runs(scores, lambda values, least=least: (values >= least).mean(axis=-1), rng)
        for least in np.asarray(thresholds, dtype=np.float64)
    ]


def _over_runs(scores: ArrayLike, statistic: Any, rng: np.random.Generator) -> Interval:
    """A statistic of all scores (runs, places), and its percentile interval."""
    table: NDArray[np.float64] = np.asarray(scores, dtype=np.float64)
    runs = len(table)
    value = float(statistic(table.ravel()))
    if runs < MIN_RUNS:
        return Interval(value, None, None, runs, f"{runs} runs: an interval needs {MIN_RUNS}")
    if (np.ptp(table, axis=0) == 0).all():
        return Interval(value, None, None, runs, "all runs are equal")
    bounds = scipy.stats.bootstrap(
        tuple(table.T),
        lambda *places, axis: statistic(np.concatenate(places, axis=axis)),
        n_resamples=RESAMPLES,
        batch=_batch(table.size),
        vectorized=True,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=rng,
    ).confidence_interval
    return Interval(value, float(bounds.low), float(bounds.high), runs)


def _batch(size: int) -> int:
    """Number of resamples of so many values to hold at a time."""
    return max(1, 1_000_000 // size)
