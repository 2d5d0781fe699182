r"""Tables and figures of a report as files: CSV with every digit, LaTeX and SVG for papers.

The LaTeX files hold a `tabular` each, which needs nothing but `\usepackage{booktabs}`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import pandas as pd

from flyrl.evaluation.episodes import Json
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.results import Results, paired, place_of
from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import Leader
from flyrl.report.wording import format_number, leader_cells, percent
from flyrl.text import csv_table, plain_name

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
_INTERACTIONS: Final = (
    "Differences of differences: the change from the usual condition, less that of the reference, "
    "on the same episodes; mean with its 95 % bootstrap interval (BCa)."
)
_LEADS: Final = (
    "Who wins where: means, and the mean difference to the next on the same episodes with its "
    "95 % interval, success in %; several names where no difference is meaningful."
)
_NOT_IN_TEXT: Final = {"\u00a0": "~", "\u2212": "$-$", "\u2013": "--", "<": "$<$", ">": "$>$"}
"""Characters that LaTeX does not print, or not as they are, outside of formulas."""


def format_tables(results: Results, leaders: Sequence[Leader]) -> dict[str, str]:
    """Name of each file -> its text.

    `summary` has success rates, and means and quartiles; `leaders` who wins where; `differences`
    the paired comparisons with the reference, where there are any; `interactions` what conditions
    change in these, where quantities were varied. As CSV each is one file with all metrics and
    terrains. In LaTeX `summary.tex` has the metrics that the task is compared by,
    `metrics-<terrain>.tex` all of them, `differences-<terrain>.tex` and
    `interactions-<terrain>.tex` the comparisons on a terrain.

    Parameters
    ----------
    leaders
        The best on each terrain under each condition.
    """
    summary = results.summaries
    compared = results.protocol["compared"]
    tables = {
        "summary": results.summary,
        "leaders": leaders_table(leaders),
        "differences": results.differences,
        "interactions": results.interactions,
    }
    printed = {
        "summary": (_printed_summary(summary, compared), _SPREADS),
        "leaders": (_printed_leaders(leaders), _LEADS),
    }
    for terrain in dict.fromkeys(row["terrain"] for row in summary):
        rows = [row for row in summary if row["terrain"] == terrain]
        name = plain_name(terrain)
        printed[f"metrics-{name}"] = _printed_metrics(rows), _SPREADS
        printed[f"differences-{name}"] = _printed_differences(rows), _DIFFERENCES
        printed[f"interactions-{name}"] = _printed_interactions(rows), _INTERACTIONS
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


def _printed_summary(summary: Sequence[Json], compared: Sequence[str]) -> pd.DataFrame:
    spreads = [metric for metric in compared if metric != "success"]
    return pd.DataFrame(
        {
            **place_of(row),
            "success (%)": _share(row["success_rate"]),
            **{metric_label(metric): _spread(row["metrics"][metric]) for metric in spreads},
        }
        for row in summary
    )


def _printed_metrics(summary: Sequence[Json]) -> pd.DataFrame:
    """A row per condition and metric, a column per controller; metrics that nobody has left out."""
    metrics = summary[0]["metrics"]
    present = [metric for metric in metrics if any(row["metrics"][metric]["n"] for row in summary)]
    cells: dict[tuple[str, str], Json] = {}
    for row in summary:
        texts = {"success (%)": _share(row["success_rate"])}
        texts |= {metric_label(metric): _spread(row["metrics"][metric]) for metric in present}
        for label, text in texts.items():
            place = {"condition": row["condition"], "metric": label}
            cells.setdefault((row["condition"], label), place)[row["controller"]] = text
    return pd.DataFrame(list(cells.values())).fillna("")


def _printed_leaders(leaders: Sequence[Leader]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "terrain": leader.terrain,
            "condition": leader.condition,
            "best": ", ".join(leader.names),
            "by": metric_label(leader.metric),
            "mean": cells["value"],
            "next": leader.next_name or "",
            "next mean": cells["next"],
            "difference": cells["difference"],
        }
        for leader in leaders
        for cells in [leader_cells(leader)]
    )


def _printed_differences(summary: Sequence[Json]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            **_compared(row, metric),
            "difference": _interval(difference),
            "p": _p(difference["p_value"]),
            "p corrected": _p(difference["p_adjusted"]),
            "better in (%)": _share(difference["improvement"]),
            "effect size": format_number(difference["effect_size"], 2),
        }
        for row, metric, difference in paired(summary, "differences")
    )


def _printed_interactions(summary: Sequence[Json]) -> pd.DataFrame:
    return pd.DataFrame(
        {**_compared(row, metric), "difference of differences": _interval(interaction)}
        for row, metric, interaction in paired(summary, "interactions")
    )


def _compared(row: Json, metric: str) -> Json:
    """What is compared in a row of a table: under which condition, who, in which metric."""
    return {
        "condition": row["condition"],
        f"controller, less {row['paired']['reference']}": row["controller"],
        "metric": metric_label(metric),
    }


def _interval(
    interval: Mapping[str, Any],
    keys: tuple[str, str, str] = ("value", "low", "high"),
    text: Callable[[float | None], str] = format_number,
) -> str:
    """A value, and the ends of its interval where it has one."""
    value, low, high = (interval[key] for key in keys)
    return text(value) if low is None else f"{text(value)} [{text(low)}, {text(high)}]"


def _share(interval: Mapping[str, Any]) -> str:
    """A share in percent, with its interval."""
    return _interval(interval, text=percent)


def _spread(distribution: Mapping[str, Any]) -> str:
    """A mean with its quartiles; of one episode alone they say nothing."""
    if distribution["n"] < 2:
        return format_number(distribution["mean"])
    return _interval(distribution, ("mean", "q1", "q3"))


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


def standalone(svg: str) -> str:
    """An SVG file from a figure that stands in a page.

    What only browsers know gives way to plain SVG 1.1: colours to their light values, references
    without a name space to `xlink:href`, a size that follows the page to one in points. Links into
    the page are left out.

    Raises
    ------
    ValueError
        It has no view box.
    """
    head, rest = svg.split(">", 1)
    box = re.search(r'viewBox="([^"]*)"', head)
    if box is None:
        raise ValueError(f"a figure needs a view box, got {head}>")
    width, height = box.group(1).split()[2:]
    rest = re.sub(r"var\(--\w+, (#[0-9a-f]{6})\)", r"\1", rest)
    rest = re.sub(r"</?a\b[^>]*>", "", rest)
    rest = rest.replace(' href="', ' xlink:href="')
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'version="1.1" width="{width}pt" height="{height}pt" {box.group()}>{rest}'
    )
