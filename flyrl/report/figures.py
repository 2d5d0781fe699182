"""Figures of a report's results.

Matplotlib's object-oriented interface only: no pyplot, no list of open figures, no window system.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flyrl.evaluation.episodes import Json
from flyrl.evaluation.metrics import metric_label
from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import metric_values, paired_values
from flyrl.report import style
from flyrl.rollouts import BoolArray
from flyrl.tasks import SUCCESS
from flyrl.validation import FloatArray

MAX_DOTS: Final = 400
"""Largest number of dots in a row; more are drawn as an outline, to keep the page small."""

BINS: Final = 60
"""Steps of an outline over the width of its panel."""

DOSE_PANELS: Final = 3
"""Panels side by side in a figure of doses."""

MAX_DOSE_LETTERS: Final = 36
"""Characters that fit below a panel on one line."""

_REACH: Final = 0.32
"""Largest distance of dots and outlines from the middle of their row."""

_ROW_HEIGHT: Final = 0.36


def success_figure(summary: Sequence[Json], condition: str = "") -> Figure:
    """Success rate of every controller with its interval, a panel per terrain.

    Parameters
    ----------
    summary
        Rows of one condition.
    condition
        Its name, as a title; empty where nothing is varied.
    """
    shade = style.colours(row["controller"] for row in summary)
    places = {name: place for place, name in enumerate(shade)}
    terrains = list(dict.fromkeys(row["terrain"] for row in summary))
    with lists(list(shade), len(terrains)) as (figure, every):
        panel = dict(zip(terrains, every, strict=True))
        for row in summary:
            name = row["controller"]
            _success(panel[row["terrain"]], row, places[name], shade[name])
        for terrain, axes in panel.items():
            ticks = [0, 25, 50, 75, 100]
            axes.set(title=terrain, xlim=(-3, 103), xticks=ticks, xlabel="success (%)")
        if condition:
            figure.suptitle(condition, x=0, ha="left", fontsize=10, color=style.MUTED)
    return figure


def _success(axes: Axes, row: Json, place: int, colour: str) -> None:
    """Draw a success rate, its interval, and beside the panel the counts."""
    rate = row["success_rate"]
    bar: Any = {"color": colour, "linewidth": 5, "alpha": 0.3, "solid_capstyle": "round"}
    axes.plot([100 * rate["low"], 100 * rate["high"]], [place, place], **bar)
    axes.plot([100 * rate["value"]], [place], "o", color=colour, markersize=8)
    axes.annotate(
        f"{row['successes']}/{row['episodes']}",
        (1.0, place),
        xycoords=("axes fraction", "data"),
        xytext=(10, 0),
        textcoords="offset points",
        va="center",
        color=style.MUTED,
    )


def distributions_figure(
    rows: pd.DataFrame, terrain: str, horizon_s: float, metrics: Sequence[str]
) -> Figure:
    """Every episode as a dot, with mean and quartiles; a panel per metric.

    Beyond `MAX_DOTS` an outline stands for the dots, its strong part for the successes among them.

    An episode without success has no time to goal: its dot stands at the horizon, and the mean
    and quartiles count it there.
    """
    shade = style.colours(rows["controller"].unique())
    owns = [_of(rows, terrain, name) for name in shade]
    with lists(list(shade), len(metrics)) as (figure, every):
        for axes, metric in zip(every, metrics, strict=True):
            values = [np.asarray(metric_values(own, metric, horizon_s)) for own in owns]
            draw_episodes(axes, values, owns, list(shade.values()))
            axes.set_xlabel(metric_label(metric))
            if metric == "time_to_goal_s":
                axes.axvline(horizon_s, color=style.LINE, linewidth=1)
                axes.set_xlim(left=0)
    return figure


def paired_figure(
    rows: pd.DataFrame, summary: Sequence[Json], terrain: str, horizon_s: float
) -> Figure | None:
    """Differences to the reference, episode by episode, with the mean and its interval."""
    compared = [row for row in summary if row["terrain"] == terrain and row["paired"]]
    if not compared:
        return None
    shade = style.colours(row["controller"] for row in summary)
    other = _of(rows, terrain, compared[0]["paired"]["reference"])
    owns = [_of(rows, terrain, row["controller"]) for row in compared]
    metrics = list(compared[0]["paired"]["differences"])
    with lists([row["controller"] for row in compared], len(metrics)) as (figure, every):
        for axes, metric in zip(every, metrics, strict=True):
            axes.axvline(0, color=style.MUTED, linewidth=1)
            drawn = [paired_values(own, other, metric, horizon_s) for own in owns]
            edges = _edges(drawn)
            for place, (row, own, values) in enumerate(zip(compared, owns, drawn, strict=True)):
                colour = shade[row["controller"]]
                if metric != "success" and values.size:
                    pairs = own[own["episode"].isin(other["episode"])].assign(outcome=SUCCESS)
                    _episodes(axes, values, pairs, place, edges, colour, alpha=0.25)
                difference = row["paired"]["differences"][metric]
                # what is None is not drawn
                ends = np.array([difference["low"], difference["high"]], dtype=np.float64)
                middle = np.array([difference["value"]], dtype=np.float64)
                axes.plot(ends, [place, place], color=style.INK, linewidth=2, zorder=4)
                dot: Any = {"color": colour, "markeredgecolor": style.INK, "markersize": 6}
                axes.plot(middle, [place], "o", zorder=5, **dot)
            if metric == "success":
                axes.set_xlim(-1.05, 1.05)
            axes.set_xlabel(f"Δ {metric_label(metric)}")
    return figure


def doses_figure(
    summary: Sequence[Json],
    terrain: str,
    quantity: str,
    labels: Sequence[str],
    metrics: Sequence[str],
) -> Figure:
    """Effect of each dose of a quantity: a panel per metric, a colour per controller.

    Success with its interval, of all other metrics the mean with quartiles; a line leads from
    number to number, and what cannot be ordered stands side by side.

    Parameters
    ----------
    labels
        Conditions in which the quantity takes its values, in order.
    metrics
        "success" and others.
    """
    rows = [row for row in summary if row["terrain"] == terrain and row["condition"] in labels]
    shade = style.colours(row["controller"] for row in rows)
    values = [label.partition("=")[2] for label in labels]
    places, is_ordered = _places(values)
    at = dict(zip(labels, places, strict=True))
    lines = math.ceil(len(metrics) / DOSE_PANELS)
    with style.panels(lines, DOSE_PANELS, 2.9 * lines) as (figure, every):
        for axes in every[len(metrics) :]:
            axes.set_axis_off()
        for axes, metric in zip(every, metrics, strict=False):
            for i, (name, colour) in enumerate(shade.items()):
                own = [row for row in rows if row["controller"] == name]
                own.sort(key=lambda row: labels.index(row["condition"]))
                x = np.array([at[row["condition"]] for row in own])
                low, middle, high = np.transpose([_dose(row, metric) for row in own])
                if is_ordered:
                    axes.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
                else:
                    x += 0.14 * (i - (len(shade) - 1) / 2)
                    axes.vlines(x, low, high, color=colour, alpha=0.35, linewidth=4)
                marks = "o-" if is_ordered else "o"
                axes.plot(x, middle, marks, color=colour, markersize=4.5, label=name)
            title = "success (%)" if metric == "success" else metric_label(metric)
            axes.set(title=title, xlabel=quantity.replace("_", " "))
            if not is_ordered:
                axes.set_xticks(places, values, fontsize=9)
                axes.grid(visible=False, axis="x")
                if max(map(len, values)) * len(values) > MAX_DOSE_LETTERS:
                    axes.tick_params(axis="x", labelrotation=20)
        style.add_legend(figure)
    return figure


def profiles_figure(profiles: Mapping[str, Sequence[Interval]], at: Sequence[float]) -> Figure:
    """Share of runs that reach at least each success rate, a line per training, with intervals."""
    with style.panels(1, 1, 3.4) as (figure, (axes,)):
        percent = 100 * np.array(at)
        for i, (name, points) in enumerate(profiles.items()):
            colour = style.SHADES[i % len(style.SHADES)]
            triples = [(point.low, point.value, point.high) for point in points]
            low, values, high = 100 * np.array(triples, dtype=np.float64).T
            band: Any = {"color": colour, "alpha": 0.15, "linewidth": 0}
            axes.fill_between(percent, low, high, step="post", **band)
            axes.step(percent, values, where="post", color=colour, label=name)
        axes.set(xlabel="success of at least (%)", ylabel="runs (%)")
        axes.set(xlim=(-1, 101), ylim=(-3, 103))
        style.add_legend(figure, ncols=2)
    return figure


def _places(values: Sequence[str]) -> tuple[list[float], bool]:
    """Places of values on an axis, and whether they are numbers, each in its place."""
    try:
        return [float(value) for value in values], True
    except ValueError:
        return [float(i) for i in range(len(values))], False


def _dose(row: Json, metric: str) -> list[float]:
    """Lower end, middle and upper end of what is drawn; NaN where there is none."""
    if metric == "success":
        ends, scale = [row["success_rate"][key] for key in ("low", "value", "high")], 100
    else:
        ends, scale = [row["metrics"][metric][key] for key in ("q1", "mean", "q3")], 1
    return [math.nan if end is None else scale * end for end in ends]


@contextmanager
def lists(
    names: Sequence[str], columns: int, *, sharex: bool = False
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure with panels side by side that share a row per name, first on top."""
    size: Any = {"height": _ROW_HEIGHT * len(names) + 0.75, "style": style.LIST_STYLE}
    with style.panels(1, columns, **size, sharex=sharex, sharey=True) as (figure, every):
        every[0].set_yticks(range(len(names)), names)
        every[0].set_ylim(len(names) - 0.45, -0.55)
        yield figure, every


def draw_episodes(
    axes: Axes,
    values: Sequence[FloatArray],
    rows: Sequence[pd.DataFrame],
    shades: Sequence[str],
) -> None:
    """Draw a row of dots (or their outline) per entrant, with mean and quartiles, first on top.

    Parameters
    ----------
    values
        Metric of each entrant's episodes, (n,) each.
    rows
        Those episodes.
    shades
        Colour of each entrant.
    """
    edges = _edges(values)
    for place, (own, episodes, shade) in enumerate(zip(values, rows, shades, strict=True)):
        if own.size:
            _episodes(axes, own, episodes, place, edges, shade)
            _quartiles(axes, own, place)


def _edges(drawn: Sequence[FloatArray]) -> FloatArray:
    """Edges of the bins that all rows of a panel share."""
    together = np.concatenate([*drawn, np.empty(0)])
    return np.histogram_bin_edges(together[np.isfinite(together)], BINS)


def _episodes(
    axes: Axes,
    values: FloatArray,
    rows: pd.DataFrame,
    place: float,
    edges: FloatArray,
    colour: str,
    *,
    alpha: float = 0.75,
) -> None:
    """The episodes of a row: dots that lead to them, or their outline if they are many."""
    if values.size <= MAX_DOTS:
        heights = place + swarm(values)
        for outcome in rows["outcome"].unique():
            chosen = (rows["outcome"] == outcome).to_numpy()
            look = style.outcome_dot(outcome, colour)
            dots = axes.scatter(values[chosen], heights[chosen], alpha=alpha, zorder=3, **look)
            places = zip(rows["terrain"][chosen], rows["episode"][chosen], strict=True)
            dots.set_urls([style.episode_url(terrain, episode) for terrain, episode in places])
        return
    is_success = (rows["outcome"] == SUCCESS).to_numpy()
    look = {"facecolor": colour, "edgecolor": colour, "linewidth": 0.8, "fill": True, "zorder": 3}
    for outline, strength in zip(outlines(values, is_success, edges), (0.4, 1), strict=True):
        ends = place + outline, place - outline
        axes.stairs(ends[0], edges, baseline=ends[1], alpha=alpha * strength, **look)


def outlines(values: FloatArray, is_success: BoolArray, edges: FloatArray) -> FloatArray:
    """Outlines of values around the middle of their row, bin by bin.

    Their height is the square root of the number of values, so that a few show beside thousands;
    NaN where there are none: nothing is drawn there.

    Parameters
    ----------
    values, is_success
        Of episodes, shape (n,).
    edges
        Of the bins, shape (bins + 1,).

    Returns
    -------
    Of all values, and within it the share of the successes, shape (2, bins).
    """
    count = np.histogram(values, edges)[0]
    successes = np.histogram(values[is_success], edges)[0]
    reach = _REACH * np.sqrt(count / max(count.max(), 1))
    share = np.divide(successes, count, out=np.zeros(count.shape), where=count > 0)
    both = np.array([reach, reach * share])
    both[both == 0] = np.nan
    return both


def _quartiles(axes: Axes, values: FloatArray, place: float) -> None:
    low, high = np.quantile(values, (0.25, 0.75))
    mean = values.mean()
    look: dict[str, Any] = {"color": style.INK, "zorder": 4, "solid_capstyle": "butt"}
    axes.plot([low, high], [place, place], linewidth=1.6, **look)
    axes.plot([mean, mean], [place - 0.32, place + 0.32], linewidth=2.2, **look)


def swarm(values: FloatArray, bins: int = 60) -> FloatArray:
    """Offsets (n,) up to `_REACH` that spread values close to one another, without chance."""
    spread = np.ptp(values) or 1.0
    cell = pd.Series(((values - values.min()) / spread * (bins - 1)).round())
    neighbours = cell.groupby(cell)
    count = neighbours.transform("size").to_numpy()
    place = neighbours.cumcount().to_numpy() - (count - 1) / 2
    return np.asarray(place * min(0.09, 2 * _REACH / count.max()))


def _of(rows: pd.DataFrame, terrain: str, name: str) -> pd.DataFrame:
    return rows[(rows["terrain"] == terrain) & (rows["controller"] == name)]
