r"""Tables and figures of a report as files: CSV with every digit, LaTeX and SVG for papers.

The LaTeX files hold a `tabular` each, which needs nothing but `\usepackage{booktabs}`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import pandas as pd

from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.results import Results, paired, place_of
from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import Leader
from flyrl.report.sections import spread_metrics
from flyrl.report.wording import format_number, percent
from flyrl.text import csv_table

LEAST_P: Final = 0.001
"""p-values below are only said to be so."""

_SPREADS: Final = (
    "Success with its 95 % Wilson interval; of the others, mean with quartiles; "
    "time to goal over successful episodes only."
)
_DIFFERENCES: Final = (
    "Mean differences on the same episodes with their 95 % bootstrap intervals (BCa); p of the "
    "sign-flip test, corrected after Benjamini and Hochberg; share of episodes in which it is the "
    "better one, ties counting half, with its interval; effect size d_z."
)
_NOT_IN_TEXT: Final = {"\u00a0": "~", "\u2212": "$-$", "\u2013": "--", "<": "$<$", ">": "$>$"}
"""Characters that LaTeX does not print, or not as they are, outside of formulas."""


def format_tables(results: Results, leaders: Sequence[Leader]) -> dict[str, str]:
    """Name of each file -> its text.

    As CSV `summary` has success rates, and means and quartiles of all metrics; `leaders` who wins
    where; `differences` the paired comparisons with the reference, where there are any;
    `interactions` what conditions change in these, where quantities were varied. In LaTeX `summary`
    has the metrics that the task is compared by, `differences` the comparisons.

    Parameters
    ----------
    leaders
        The best on each terrain under each condition.
    """
    tables = {
        "summary": results.summary,
        "leaders": leaders_table(leaders),
        "differences": results.differences,
        "interactions": results.interactions,
    }
    printed = {
        "summary": (_printed_summary(results), _SPREADS),
        "differences": (_printed_differences(results), _DIFFERENCES),
    }
    return {
        **{f"{name}.csv": csv_table(table) for name, table in tables.items() if len(table)},
        **{f"{name}.tex": _latex(*each) for name, each in printed.items() if len(each[0])},
    }


def leaders_table(leaders: Sequence[Leader]) -> pd.DataFrame:
    """A row per condition and terrain: who is best, by which metric, and how far ahead of the next.

    Means of the metric, and the mean difference with its interval; empty where nobody comes next.
    Several of the best, whom nothing tells apart, stand with a comma in between.
    """
    return pd.DataFrame(
        {
            "terrain": leader.terrain,
            "condition": leader.condition,
            "best": ", ".join(leader.names),
            "metric": leader.metric,
            "mean": leader.value,
            "next": leader.next_name,
            "next_mean": leader.next_value,
            "difference": ahead.value,
            "low": ahead.low,
            "high": ahead.high,
            "no_interval": ahead.reason,
        }
        for leader in leaders
        for ahead in [leader.difference or Interval(None, None, None, 0)]
    )


def _printed_summary(results: Results) -> pd.DataFrame:
    spreads = spread_metrics(results.protocol)
    return pd.DataFrame(
        {
            **place_of(row),
            "success (%)": _share(row["success_rate"]),
            **{metric_label(metric): _spread(row["metrics"][metric]) for metric in spreads},
        }
        for row in results.summaries
    )


def _printed_differences(results: Results) -> pd.DataFrame:
    return pd.DataFrame(
        {
            **place_of(row),
            "metric": metric_label(metric),
            f"less {row['paired']['reference']}": _with_ends(difference, "value", "low", "high"),
            "p": _p(difference["p_value"]),
            "p corrected": _p(difference["p_adjusted"]),
            "better in (%)": _share(difference["improvement"]),
            "effect size": format_number(difference["effect_size"], 2),
        }
        for row, metric, difference in paired(results.summaries, "differences")
    )


def _share(interval: Mapping[str, Any]) -> str:
    """A share in percent, with its interval."""
    return _with_ends(interval, "value", "low", "high", percent)


def _spread(distribution: Mapping[str, Any]) -> str:
    """A mean with its quartiles; of one episode alone they say nothing."""
    if distribution["n"] < 2:
        return format_number(distribution["mean"])
    return _with_ends(distribution, "mean", "q1", "q3")


def _with_ends(
    found: Mapping[str, Any], value: str, low: str, high: str, text: Any = format_number
) -> str:
    """A value, and the ends of its interval where it has one."""
    middle = text(found[value])
    return middle if found[low] is None else f"{middle} [{text(found[low])}, {text(found[high])}]"


def _p(value: float | None) -> str:
    if value is None:
        return format_number(None)
    return f"<{LEAST_P}" if value < LEAST_P else f"{value:.3f}"


def _latex(table: pd.DataFrame, caption: str) -> str:
    """A `tabular` below a comment; no text in the table is LaTeX."""
    if not table["condition"].any():
        table = table.drop(columns="condition")
    text = table.replace(r"\s*[\r\n]+\s*", " ", regex=True).to_latex(index=False, escape=True)
    # at the start of a row these would be arguments of the command before
    text = re.sub(r"(?m)^([*\[])", r"{\1}", text)
    for character, formula in _NOT_IN_TEXT.items():
        text = text.replace(character, formula)
    return f"% {caption}\n{text}"
