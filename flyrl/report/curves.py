"""Learning curves, of a run or of many: success and return over the decisions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, PercentFormatter

from flyrl.files import replacing
from flyrl.report.style import INK, SHADES, STYLE, panels

_DASHES: Final = ("-", "--", ":", "-.")
_PANELS: Final = ("success_rate", "mean_return")
_LEGEND_WIDTH: Final = 90
"""Characters of a line below the figure."""

_LEGEND_LINE: Final = 0.17
"""Height of such a line, inches."""

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
    rows = pd.DataFrame(evaluations, columns=["decisions", *_PANELS])
    with _success_and_return(title) as (figure, both):
        line: dict[str, Any] = {"color": SHADES[0], "marker": "o", "markersize": 4}
        ring: dict[str, Any] = {"s": 90, "facecolors": "none", "edgecolors": INK, "zorder": 3}
        best = rows.sort_values([*_PANELS], ascending=False, kind="stable").head(1)
        if training:
            both[1].plot(*np.transpose(training), color=SHADES[7], linewidth=1, label="training")
        for axes, key in zip(both, _PANELS, strict=True):
            axes.plot(rows["decisions"], rows[key], label="held-out", **line)
            axes.scatter(best["decisions"], best[key], **ring)
        both[1].set_ylabel("return")
        both[1].legend(loc="best")
    return figure


@contextmanager
def _success_and_return(title: str, width: float = 7) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure with an empty panel for success, and one for returns below."""
    with panels(2, 1, 5, width=width, sharex=True) as (figure, (upper, lower)):
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        upper.set(ylim=(-0.03, 1.03), ylabel="held-out success")
        upper.yaxis.set_major_formatter(PercentFormatter(1))
        lower.set(xlabel="decisions")
        lower.xaxis.set_major_formatter(EngFormatter(sep=""))
        yield figure, [upper, lower]
        lower.set_xlim(left=0)


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
    figure = learning_curve(evaluations, training, folder.name)
    return save_figure(figure, folder, "learning_curve")


def learning_curves(
    groups: Sequence[tuple[str, Sequence[Evaluations]]],
    title: str = "",
    lower: str = "mean_return",
    *,
    width: float = 7,
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
    width
        Of the figure, inches.
    """
    with _success_and_return(title, width) as (figure, both):
        for index, (name, runs) in enumerate(groups):
            drawn = [pd.DataFrame(run).set_index("decisions") for run in runs if run]
            if not drawn:
                continue
            dashes, shade = divmod(index, len(SHADES))
            line: dict[str, Any] = {"color": SHADES[shade], "linestyle": _DASHES[dashes % 4]}
            mean = {**line, "marker": "o", "markersize": 3, "zorder": 3}
            for axes, key in zip(both, (_PANELS[0], lower), strict=True):
                for run in drawn:
                    axes.plot(run.index, run[key], linewidth=0.8, alpha=0.35, **line)
                shared = pd.concat([run[key] for run in drawn], axis=1, join="inner").sort_index()
                label = f"{name}, n = {len(drawn)}"
                axes.plot(shared.index, shared.mean(axis=1), label=label, **mean)
        both[1].set_ylabel(f"held-out {lower.removeprefix('mean_').replace('_', ' ')}")
        _add_legend(figure, both[0])
    return figure


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
    figure = learning_curves(groups, title, lower)
    return save_figure(figure, folder, "learning_curves")


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as `name.svg` and `name.png` into a folder; return their paths."""
    paths = [folder / f"{name}.{kind}" for kind in ("svg", "png")]
    for path, metadata in zip(paths, ({"Date": None}, None), strict=True):
        with replacing(path) as partial, mpl.rc_context(STYLE):
            figure.savefig(partial, format=path.suffix[1:], dpi=150, metadata=metadata)
    return paths
