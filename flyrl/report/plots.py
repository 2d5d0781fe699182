"""Figures that another library draws with pyplot, written as the others are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from flyrl.report.curves import save_figure

_STYLE: Final[Any] = {
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "flyrl",
    "text.parse_math": False,
}


def write_plots(folder: Path, drawings: Mapping[str, Callable[[], Any]]) -> list[Path]:
    """Draw figures without a window, and write each as SVG and PNG.

    Parameters
    ----------
    folder
        Where to.
    drawings
        Name of the files -> function that draws with pyplot, and returns the axes, or an array of
        them. The style that it sets does not outlast it.

    Returns
    -------
    Paths of the files.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    mpl.use("agg")
    paths = []
    for name, draw in drawings.items():
        with mpl.rc_context(_STYLE):
            figure = np.atleast_1d(draw()).flat[0].figure
            try:
                paths += save_figure(figure, folder, name)
            finally:
                plt.close(figure)
    return paths
