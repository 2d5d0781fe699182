"""Progress bars, on stderr, that look alike wherever something takes long."""

import sys
from typing import Final, NoReturn

from tqdm import tqdm

TERMINAL_INTERVAL_S: Final = 0.5
FILE_INTERVAL_S: Final = 30.0


def progress_bar(
    total: int,
    *,
    is_shown: bool,
    unit: str,
    unit_scale: float = 1,
    description: str | None = None,
    layout: str | None = None,
) -> "tqdm[NoReturn]":
    """Make a progress bar: a moving one on a terminal, a line now and then in a log file.

    Parameters
    ----------
    total
        Steps that it counts to.
    is_shown
        Whether to draw it at all.
    unit
        What is counted.
    unit_scale
        Units per step.
    description
        Stands in front.
    layout
        Format of the line, tqdm's `bar_format`; None takes tqdm's own.
    """
    return tqdm(
        total=total,
        desc=description,
        unit=unit,
        unit_scale=False if unit_scale == 1 else unit_scale,
        bar_format=layout,
        disable=not is_shown,
        mininterval=TERMINAL_INTERVAL_S if sys.stderr.isatty() else FILE_INTERVAL_S,
        dynamic_ncols=True,
    )
