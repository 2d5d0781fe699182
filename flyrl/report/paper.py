"""How figures look that are files of their own: the light colours of reports, on white."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from flyrl.report.palette import THEME
from flyrl.report.style import FRAMED_STYLE


def light(name: str) -> str:
    """Light value of a theme colour."""
    return THEME[name][0]


PAPER_STYLE: Final[Any] = {
    **FRAMED_STYLE,
    "text.color": light("ink"),
    "axes.edgecolor": light("line"),
    "axes.labelcolor": light("muted"),
    "axes.facecolor": "white",
    "figure.facecolor": "white",
    "xtick.color": light("line"),
    "xtick.labelcolor": light("muted"),
    "ytick.color": light("line"),
    "ytick.labelcolor": light("muted"),
    "grid.color": light("line"),
    "axes.grid": True,
    # the first labels of both axes keep apart
    "xtick.major.pad": 6,
}

LEG_COLOURS: Final = ("c0", "c4", "c3", "c1", "c5", "c2")
"""Theme colours of the legs, ordered as `anatomy.LEGS`."""


class Plot(NamedTuple):
    """A figure, and the numbers that it shows.

    Attributes
    ----------
    figure
        Of matplotlib.
    table
        A row per point, or per whatever else it shows.
    """

    figure: Figure
    table: pd.DataFrame
