"""The literature's comparison of leg controllers on four terrains, walked anew.

After Wang-Chen et al. 2024 (doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.report.figures import METRIC_LABELS, swarm
from flyrl.report.palette import colours
from flyrl.report.paper import PAPER_STYLE, Plot, light
from flyrl.report.style import WIDTH_IN, outcome_dot
from flyrl.report.wording import outcome_name
from flyrl.terrains import LITERATURE

STUDY: Final = EvaluationConfig(
    task={"name": "traverse", "time_limit": 1.5},
    controllers=("cpg", "rule_based", "hybrid"),
    terrains=LITERATURE,
    episodes=20,
    paths=0,
)
"""The setting of `experiment=controller_comparison`, without a learned policy."""

_ROWS: Final = 40
"""Dots that fit above one another."""

METRIC: Final = "speed_mm_s"
COLUMNS: Final = (
    "terrain", "controller", "episode", "outcome", "duration_s", "displacement_mm", METRIC,
)  # fmt: skip


def comparison_plot(config: EvaluationConfig = STUDY) -> Plot:
    """Let the controllers walk the same episodes, and draw the speed of each.

    Raises
    ------
    ValueError
        If the config names something that there is not.
    """
    return draw_comparison(evaluate(config).episodes)


def draw_comparison(episodes: pd.DataFrame) -> Plot:
    """Every episode's speed as a dot, with the mean; a panel per terrain.

    Parameters
    ----------
    episodes
        Of results of an evaluation.
    """
    table = episodes[list(COLUMNS)]
    names = list(table["controller"].unique())
    terrains = list(table["terrain"].unique())
    highest = float(table[METRIC].max())
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
        panels = figure.subplots(1, len(terrains), sharey=True, squeeze=False).ravel()
        for axes, terrain in zip(panels, terrains, strict=True):
            for place, (name, shade) in enumerate(colours(names).items()):
                chosen = (table["terrain"] == terrain) & (table["controller"] == name)
                _dots(axes, table[chosen], place, light(shade), highest)
            axes.set_title(terrain, loc="left")
            axes.set_xticks(range(len(names)), [name.replace("_", "-") for name in names])
            axes.set_xlim(-0.6, len(names) - 0.4)
            axes.grid(visible=False, axis="x")
        panels[0].set_ylabel(METRIC_LABELS[METRIC])
        panels[0].set_ylim(bottom=min(0.0, table[METRIC].min()))
        figure.legend(handles=_legend(table), loc="outside lower center", ncols=4)
    return Plot(figure, table)


def _dots(axes: Axes, rows: pd.DataFrame, place: int, shade: str, highest: float) -> None:
    values = rows[METRIC].to_numpy(dtype=np.float64)
    if not values.size:
        return
    # dots that are closer than one is high stand side by side
    aside = place + swarm(values, max(2, round(_ROWS * np.ptp(values) / highest)))
    for outcome in rows["outcome"].unique():
        chosen = (rows["outcome"] == outcome).to_numpy()
        dot = outcome_dot(outcome, shade)
        axes.scatter(aside[chosen], values[chosen], zorder=3, **dot)
    mean = float(np.mean(values))
    axes.plot([place - 0.36, place + 0.36], [mean, mean], color=light("ink"), linewidth=2)


def _legend(rows: pd.DataFrame) -> list[Line2D]:
    """What dots and lines mean."""
    handles = []
    for outcome in rows["outcome"].unique():
        dot = outcome_dot(outcome, light("muted"))
        handles.append(
            Line2D(
                [],
                [],
                linestyle="",
                marker=dot["marker"],
                markersize=5,
                color=light("muted"),
                markerfacecolor=dot.get("facecolors", light("muted")),
                label=f"an episode: {outcome_name(outcome)}",
            )
        )
    return [*handles, Line2D([], [], color=light("ink"), linewidth=2, label="mean")]
