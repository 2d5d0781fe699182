"""Summaries of an evaluation as tables, a row per thing that is compared."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from flyrl.evaluation.rows import Json


def summary_table(summary: Sequence[Json]) -> pd.DataFrame:
    """A row per terrain, condition and controller: success with its interval, and all metrics.

    Of a metric `m` stand there `m_n`, the number of episodes that have it, `m_mean`, `m_median`,
    `m_q1` and `m_q3`; NaN without any.
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
        for row in summary
    )


def differences_table(summary: Sequence[Json]) -> pd.DataFrame:
    """A row per terrain, condition, controller and metric: how it compares with the reference.

    Mean difference with its interval, or the reason why it has none; p-value, plain and corrected;
    probability of improvement with its interval; effect size.
    """
    return pd.DataFrame(
        {
            **place_of(row),
            "reference": row["paired"]["reference"],
            "metric": metric,
            "pairs": difference["n"],
            "difference": difference["value"],
            "low": difference["low"],
            "high": difference["high"],
            "no_interval": difference["reason"],
            "p": difference["p_value"],
            "p_corrected": difference["p_adjusted"],
            "improvement": difference["improvement"]["value"],
            "improvement_low": difference["improvement"]["low"],
            "improvement_high": difference["improvement"]["high"],
            "effect_size": difference["effect_size"],
        }
        for row, metric, difference in compared_pairs(summary)
    )


def interactions_table(summary: Sequence[Json]) -> pd.DataFrame:
    """A row per terrain, condition, controller and metric: difference of differences.

    The controller's change from the usual condition less that of the reference, with its interval,
    or the reason why it has none.
    """
    return pd.DataFrame(
        {
            **place_of(row),
            "reference": row["paired"]["reference"],
            "metric": metric,
            "episodes": interaction["n"],
            "interaction": interaction["value"],
            "low": interaction["low"],
            "high": interaction["high"],
            "no_interval": interaction["reason"],
        }
        for row, metric, interaction in interacting_pairs(summary)
    )


def compared_pairs(summary: Sequence[Json]) -> list[tuple[Json, str, Json]]:
    """Rows that are compared with the reference, with every metric and the difference in it."""
    return [
        (row, metric, difference)
        for row in summary
        if row["paired"]
        for metric, difference in row["paired"]["differences"].items()
    ]


def place_of(row: Json) -> Json:
    """Where a row of a summary belongs: its terrain, condition and controller."""
    return {key: row[key] for key in ("terrain", "condition", "controller")}


def interacting_pairs(summary: Sequence[Json]) -> list[tuple[Json, str, Json]]:
    """Rows under a condition that changes something, with every metric and its interaction."""
    return [
        (row, metric, interaction)
        for row in summary
        for metric, interaction in ((row["paired"] or {}).get("interactions") or {}).items()
    ]
