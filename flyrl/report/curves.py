"""The learning curve of a run: success and return over the decisions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, PercentFormatter

from flyrl.files import replacing
from flyrl.report.palette import THEME

FORMATS: Final = ("svg", "png")

_INK, _LINE = THEME["ink"][0], THEME["line"][0]
_HELD_OUT, _TRAINING = THEME["c0"][0], THEME["c7"][0]
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


def learning_curve(
    evaluations: Sequence[Mapping[str, float]],
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
        figure = Figure(figsize=(7, 5), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        line = {"color": _HELD_OUT, "marker": "o", "markersize": 4}
        upper.plot(decisions, [row["success_rate"] for row in evaluations], **line)
        upper.set_ylim(-0.03, 1.03)
        upper.yaxis.set_major_formatter(PercentFormatter(1))
        upper.set_ylabel("held-out success")
        if training:
            x, y = np.array(training, dtype=float).T
            lower.plot(x, y, color=_TRAINING, linewidth=1, label="training")
        returns = [row["mean_return"] for row in evaluations]
        lower.plot(decisions, returns, label="held-out", **line)
        lower.set_ylabel("return")
        lower.set_xlabel("decisions")
        lower.set_xlim(left=0)
        lower.xaxis.set_major_formatter(EngFormatter(sep=""))
        lower.legend(loc="best")
        if evaluations:
            best = max(evaluations, key=lambda row: (row["success_rate"], row["mean_return"]))
            ring = {"s": 90, "facecolors": "none", "edgecolors": _INK, "zorder": 3}
            for axes, key in ((upper, "success_rate"), (lower, "mean_return")):
                axes.scatter([best["decisions"]], [best[key]], **ring)
    return figure


def write_learning_curve(
    folder: Path,
    evaluations: Sequence[Mapping[str, float]],
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
    figure = learning_curve(evaluations, training, folder.name)
    FigureCanvasAgg(figure)
    with mpl.rc_context(_STYLE):
        return save_figure(figure, folder, "learning_curve")


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
