"""Curves over the simulated time of one episode, to run along with its videos."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flyrl.report.palette import colours, marker
from flyrl.report.style import FRAMED_STYLE, WIDTH_IN, svg_text
from flyrl.rollouts import EpisodeRecord

FloatArray = NDArray[np.float64]
Box = tuple[float, float, float, float]

STRIDE_S: Final = 0.1
"""Over which a speed is taken, s: about a stride, within which the thorax rocks."""

_POINTS_PER_INCH: Final = 72
"""Units of an SVG's view box per inch."""


@dataclass(frozen=True)
class TimeFigure:
    """A figure whose horizontal axes are all the same time, and where they are in it.

    Attributes
    ----------
    svg
        The figure.
    panels
        Left, top, right and bottom of each panel, in units of the SVG's view box.
    until_s
        Time at the right of each panel, s; at the left it is 0.
    """

    svg: str
    panels: list[Box]
    until_s: float


@dataclass(frozen=True)
class _Quantity:
    """What a panel shows: values (T,) of a record; whether each was held up to its sample."""

    title: str
    values: Callable[[EpisodeRecord], FloatArray]
    is_held: bool = False


def time_figure(
    records: Sequence[EpisodeRecord], name: str, until_s: float | None = None
) -> TimeFigure:
    """Way, speed and drives (or tensions) over the time of one episode, a line per controller.

    A line that ends with a dot ends with its episode.

    Parameters
    ----------
    records
        Of everyone on the same episode, at least one.
    name
        Of the figure, for its ids.
    until_s
        Time to be shown, s; all of it by default.
    """
    until_s = until_s or max(record.duration_s for record in records)
    shade = colours([record.controller for record in records])
    with mpl.rc_context(FRAMED_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.9), layout="constrained")
        panels = figure.subplots(2, 2, sharex=True)
        panels[1, 1].sharey(panels[1, 0])  # the drives
        for axes, quantity in zip(panels.ravel(), _quantities(records), strict=True):
            for record in records:
                _line(axes, record, quantity, until_s, marker(shade[record.controller]))
            axes.set_title(quantity.title, loc="left")
            axes.grid(visible=True)
            axes.set_xlim(0, until_s)
        for axes in panels[-1]:
            axes.set_xlabel("simulated time (s)")
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower left", ncols=6)
        # the layout is settled only by drawing
        svg = svg_text(figure, name)
        return TimeFigure(svg, [_box(axes, figure) for axes in panels.ravel()], until_s)


def _quantities(records: Sequence[EpisodeRecord]) -> list[_Quantity]:
    has_goal = bool(records[0].episode.goal)
    return [
        _Quantity("distance to the goal (mm)", goal_distance_mm)
        if has_goal
        else _Quantity("way along +x (mm)", advance_mm),
        _Quantity(f"speed, {STRIDE_S:g} s mean (mm/s)", speed_mm_s),
        *_commands(records[0]),
    ]


def _commands(record: EpisodeRecord) -> list[_Quantity]:
    """What a fly is commanded, or what a worm's muscles exert."""
    if record.creature == "fly":
        return [
            _Quantity("left drive", lambda record: held_drive(record)[:, 0], is_held=True),
            _Quantity("right drive", lambda record: held_drive(record)[:, 1], is_held=True),
        ]
    return [
        _Quantity("tension of the first muscle", lambda r: held_drive(r)[:, 0], is_held=True),
        _Quantity("mean tension", lambda r: held_drive(r).mean(axis=1), is_held=True),
    ]


def _line(
    axes: Axes, record: EpisodeRecord, quantity: _Quantity, until_s: float, shade: str
) -> None:
    values = quantity.values(record)
    # up to the first sample that is not shown, so that the line reaches the edge
    shown = slice(int(np.searchsorted(record.time_s, until_s)) + 1)
    axes.plot(
        record.time_s[shown],
        values[shown],
        color=shade,
        linewidth=1.4,
        drawstyle="steps-pre" if quantity.is_held else "default",
        label=record.controller,
    )
    drawn = np.flatnonzero(np.isfinite(values))
    if record.duration_s <= until_s + 1e-9 and drawn.size:
        end = record.time_s[drawn[-1:]], values[drawn[-1:]]
        axes.plot(*end, "o", color=shade, markersize=4, clip_on=False)


def _box(axes: Axes, figure: Figure) -> Box:
    """Left, top, right, bottom of a panel; matplotlib counts from below, SVG from above."""
    width, height = _POINTS_PER_INCH * figure.get_size_inches()
    place = axes.get_position()
    box = (place.x0 * width, (1 - place.y1) * height, place.x1 * width, (1 - place.y0) * height)
    left, top, right, bottom = (round(float(edge), 2) for edge in box)
    return left, top, right, bottom


def advance_mm(record: EpisodeRecord) -> FloatArray:
    """Way along +x since the start, mm, shape (T,)."""
    way: FloatArray = record.position_w[:, 0] - record.position_w[0, 0]
    return way


def goal_distance_mm(record: EpisodeRecord) -> FloatArray:
    """Horizontal distance from the thorax to the goal, mm, shape (T,)."""
    x, y = (record.position_w[:, :2] - record.episode.goal).T
    distance: FloatArray = np.hypot(x, y)
    return distance


def speed_mm_s(record: EpisodeRecord) -> FloatArray:
    """Horizontal speed of the thorax over `STRIDE_S` around each sample, mm/s, shape (T,).

    NaN where the record does not hold the whole window: a shorter one would show the sway within
    a stride.
    """
    time_s = record.time_s
    start, end = time_s - STRIDE_S / 2, time_s + STRIDE_S / 2
    distance = [
        np.interp(end, time_s, column) - np.interp(start, time_s, column)
        for column in record.position_w[:, :2].T
    ]
    is_whole = (start > time_s[0] - 1e-9) & (end < time_s[-1] + 1e-9)
    return np.where(is_whole, np.hypot(*distance) / STRIDE_S, np.nan)


def held_drive(record: EpisodeRecord) -> FloatArray:
    """Drives or tensions held up to each sample, shape (T, k); at the start the first of all."""
    drive = record.drive.copy()
    drive[0] = drive[min(1, len(drive) - 1)]
    return drive
