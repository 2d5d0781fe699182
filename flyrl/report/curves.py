"""Learning curves, of a run or of many: success and return over the decisions."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, PercentFormatter

from flyrl.files import replacing
from flyrl.report.style import FRAMED_STYLE, THEME, WIDTH_IN, marker, svg_text

FORMATS: Final = ("svg", "png")

_INK, _LINE = THEME["ink"][0], THEME["line"][0]
_HELD_OUT, _TRAINING = THEME["c0"][0], THEME["c7"][0]
_COLOURS: Final = [name for name in THEME if name.startswith("c")]
_DASHES: Final = ("-", "--", ":", "-.")
_PANELS: Final = ("success_rate", "mean_return")
_LEGEND_WIDTH: Final = 90
"""Characters of a line below the figure."""

_LEGEND_LINE: Final = 0.17
"""Height of such a line, inches."""

_STYLE: Final[Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "flyrl",
    "text.parse_math": False,
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.edgecolor": _LINE,
    "grid.color": _LINE,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}

_THEMED_STYLE: Final[Any] = {**FRAMED_STYLE, "axes.grid": True}

Evaluations = Sequence[Mapping[str, float]]


def learning_curve(
    evaluations: Evaluations,
    training: Sequence[tuple[float, float]],
    title: str = "",
) -> Figure:
    """Success on the held-out episodes on top, returns there and in training below.

    Parameters
    ----------
    evaluations
        With `decisions`, `success_rate` and `mean_return` each. The best one gets a ring.
    training
        Pairs of decisions and the mean return of the latest training episodes.
    title
        Above the figure.
    """
    decisions = [row["decisions"] for row in evaluations]
    with mpl.rc_context(_STYLE):
        figure, upper, lower = _panels(title)
        line: dict[str, Any] = {"color": _HELD_OUT, "marker": "o", "markersize": 4}
        upper.plot(decisions, [row["success_rate"] for row in evaluations], **line)
        if training:
            x, y = np.array(training, dtype=float).T
            lower.plot(x, y, color=_TRAINING, linewidth=1, label="training")
        returns = [row["mean_return"] for row in evaluations]
        lower.plot(decisions, returns, label="held-out", **line)
        lower.set_ylabel("return")
        lower.set_xlim(left=0)
        lower.legend(loc="best")
        if evaluations:
            best = max(evaluations, key=lambda row: (row["success_rate"], row["mean_return"]))
            ring: dict[str, Any] = {"s": 90, "facecolors": "none", "edgecolors": _INK, "zorder": 3}
            for axes, key in zip((upper, lower), _PANELS, strict=True):
                axes.scatter([best["decisions"]], [best[key]], **ring)
    return figure


def _panels(title: str) -> tuple[Figure, Axes, Axes]:
    """A figure with an empty panel for success, and one for returns below."""
    figure = Figure(figsize=(7, 5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    upper.set_ylim(-0.03, 1.03)
    upper.yaxis.set_major_formatter(PercentFormatter(1))
    upper.set_ylabel("held-out success")
    lower.set_xlabel("decisions")
    lower.xaxis.set_major_formatter(EngFormatter(sep=""))
    return figure, upper, lower


def write_learning_curve(
    folder: Path,
    evaluations: Evaluations,
    training: Sequence[tuple[float, float]],
) -> list[Path]:
    """Write `learning_curve.svg` and `.png` into a run folder; return their paths.

    Parameters
    ----------
    folder
        Its name is the title.
    evaluations, training
        As in `learning_curve`; with nothing in either, nothing is written.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    if not evaluations and not training:
        return []
    return _write(learning_curve(evaluations, training, folder.name), folder, "learning_curve")


def learning_curves(
    groups: Sequence[tuple[str, Sequence[Evaluations]]],
    title: str = "",
    lower: str = "mean_return",
    *,
    is_themed: bool = False,
) -> Figure:
    """Success and return on the held-out episodes: a line per group, a pale one per run.

    A group's line is the mean of its runs, at the decisions where all of them were evaluated.

    Parameters
    ----------
    groups
        Label of each, and the evaluations of every run in it, as in `learning_curve`. Runs without
        an evaluation are left out; a group without any is not in the legend, but keeps its colour.
    title
        Above the figure.
    lower
        Column of the evaluations in the lower panel; all have it.
    is_themed
        Whether colours are markers of the report's theme.
    """
    with mpl.rc_context(_THEMED_STYLE if is_themed else _STYLE):
        figure, *both = _panels(title)
        for index, (label, runs) in enumerate(groups):
            drawn = [{row["decisions"]: row for row in run} for run in runs if run]
            if not drawn:
                continue
            dashes, colour = divmod(index, len(_COLOURS))
            name = _COLOURS[colour]
            line: dict[str, Any] = {"color": marker(name) if is_themed else THEME[name][0]}
            line["linestyle"] = _DASHES[dashes % len(_DASHES)]
            mean = {**line, "marker": "o", "markersize": 3, "zorder": 3}
            shared = sorted(set(drawn[0]).intersection(*drawn[1:]))
            for axes, key in zip(both, (_PANELS[0], lower), strict=True):
                for run in drawn:
                    values = [row[key] for row in run.values()]
                    axes.plot(list(run), values, linewidth=0.8, alpha=0.35, **line)
                means = [fmean(run[decisions][key] for run in drawn) for decisions in shared]
                axes.plot(shared, means, label=f"{label}, n = {len(drawn)}", **mean)
        both[1].set_ylabel(f"held-out {lower.removeprefix('mean_').replace('_', ' ')}")
        both[1].set_xlim(left=0)
        _add_legend(figure, both[0])
    return figure


def learning_curves_svg(groups: Sequence[tuple[str, Sequence[Evaluations]]], name: str) -> str:
    """`learning_curves` to stand inside a report, in the colours of its theme.

    Parameters
    ----------
    groups
        As in `learning_curves`.
    name
        Of the figure, for its ids.
    """
    figure = learning_curves(groups, is_themed=True)
    figure.set_figwidth(WIDTH_IN)
    with mpl.rc_context(_THEMED_STYLE):
        return svg_text(figure, name)


def _add_legend(figure: Figure, axes: Axes) -> None:
    """Tell below the figure what the lines in `axes` are, however many and long the labels."""
    handles, labels = axes.get_legend_handles_labels()
    labels = [textwrap.fill(label, _LEGEND_WIDTH) for label in labels]
    width = max((len(label) for label in labels), default=0) + 6  # with the line before it
    columns = max(1, min(len(labels), _LEGEND_WIDTH // width))
    lines = sum(label.count("\n") + 1 for label in labels) / columns
    figure.set_figheight(figure.get_figheight() + _LEGEND_LINE * lines)
    figure.legend(handles, labels, loc="outside lower left", ncols=columns, fontsize=9)


def write_learning_curves(
    folder: Path,
    groups: Sequence[tuple[str, Sequence[Evaluations]]],
    title: str = "",
    lower: str = "mean_return",
) -> list[Path]:
    """Write `learning_curves.svg` and `.png` into a folder; return their paths.

    Parameters
    ----------
    folder
        Of a sweep, say.
    groups, title, lower
        As in `learning_curves`; without a single evaluation, nothing is written.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    if not any(run for _, runs in groups for run in runs):
        return []
    return _write(learning_curves(groups, title, lower), folder, "learning_curves")


def _write(figure: Figure, folder: Path, name: str) -> list[Path]:
    FigureCanvasAgg(figure)
    with mpl.rc_context(_STYLE):
        return save_figure(figure, folder, name)


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as `name.svg` and `name.png` into a folder; return their paths."""
    paths = []
    for kind in FORMATS:
        path = folder / f"{name}.{kind}"
        with replacing(path) as partial:
            metadata = {"Date": None} if kind == "svg" else None
            figure.savefig(partial, format=kind, dpi=150, metadata=metadata)
        paths.append(path)
    return paths
