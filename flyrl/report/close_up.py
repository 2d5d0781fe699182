"""Figures of single episodes: gait diagrams, curves beside videos; and of what drives do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from flyrl.anatomy import LEGS
from flyrl.evaluation.drive_map import DriveMap, Steering
from flyrl.evaluation.metrics import counted_stance
from flyrl.report.style import FIGURE_STYLE, FRAMED_STYLE, WIDTH_IN, colours, marker, svg_text
from flyrl.rollouts import BoolArray, EpisodeRecord

SHOWN_S: Final = 1.0
"""How much of an episode a gait diagram shows, s: twelve strides."""

MAX_VISITED: Final = 500
"""Drives of a policy that are drawn at most."""

MAX_STEERING: Final = 12
"""Policies whose steering is drawn at most."""

_STEERING_COLUMNS: Final = 3

_REFLEXES: Final = {"retraction": ("muted", 0.36), "stumbling": ("ink", -0.5)}
"""Colour, and place of its line beside the bar of a leg."""


def gait_figure(records: Sequence[EpisodeRecord], name: str) -> str:
    """Gait diagrams, one above the other: stance as bars, leg by leg, and what reflexes do.

    Parameters
    ----------
    records
        Of episodes with a log of the gait.
    name
        Of the figure, for its ids.
    """
    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 0.35 + 1.25 * len(records)), layout="constrained")
        panels = figure.subplots(len(records), 1, sharex=True, squeeze=False).ravel()
        shade = colours([record.controller for record in records])
        for axes, record in zip(panels, records, strict=True):
            _raster(axes, record, marker(shade[record.controller]))
        panels[-1].set_xlabel("time (s)")
        return svg_text(figure, name)


def _raster(axes: Axes, record: EpisodeRecord, shade: str) -> None:
    gait = record.gait
    assert gait is not None
    stance = counted_stance(record)
    for leg in range(len(LEGS)):
        bars = spans(stance[:, leg], gait.interval_s)
        axes.broken_barh(bars, (leg - 0.32, 0.64), facecolor=shade, linewidth=0)
        for reflex, (colour, place) in _REFLEXES.items():
            marks = spans(getattr(gait, reflex)[:, leg], gait.interval_s)
            axes.broken_barh(marks, (leg + place, 0.14), facecolor=marker(colour), linewidth=0)
    axes.set_yticks(range(len(LEGS)), LEGS)
    axes.set_ylim(len(LEGS) - 0.4, -0.6)
    axes.set_xlim(0, min(SHOWN_S, record.duration_s))
    axes.set_title(record.controller, loc="left", fontweight="bold")


def spans(raster: BoolArray, interval_s: float) -> list[tuple[float, float]]:
    """Start and length, s, of each time that a raster (S,) is true."""
    padded = np.concatenate([[False], raster, [False]]).astype(np.int8)
    starts, ends = (np.flatnonzero(np.diff(padded) == step) for step in (1, -1))
    return [
        (float(start * interval_s), float((end - start) * interval_s))
        for start, end in zip(starts, ends, strict=True)
    ]


def drive_map_figure(
    drive_map: DriveMap, visited: Mapping[str, NDArray[np.floating[Any]]], name: str
) -> str:
    """Speed and yaw rate over the drive plane, with the drives that policies chose on top.

    Parameters
    ----------
    visited
        Drives (T, 2) by name of the controller.
    name
        Of the figure, for its ids.
    """
    drives = drive_map.drives
    panels = [
        ("speed (mm/s)", drive_map.speed_mm_s, drive_map.speed_error_mm_s),
        (
            "yaw rate (deg/s), left positive",
            drive_map.yaw_rate_deg_s,
            drive_map.yaw_rate_error_deg_s,
        ),
    ]
    shade = colours(list(visited))
    with mpl.rc_context(FRAMED_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.2), layout="constrained")
        for axes, (title, values, errors) in zip(
            figure.subplots(1, 2, squeeze=False).ravel(), panels, strict=True
        ):
            levels = MaxNLocator(9).tick_values(np.nanmin(values), np.nanmax(values))
            is_noise = False if errors is None else errors > np.diff(levels).min()
            sure = np.ma.masked_where(is_noise | np.isnan(values), values)
            lines = axes.contour(
                drives, drives, sure, levels, colors=marker("muted"), linewidths=1.1
            )
            axes.clabel(lines, fontsize=8, fmt="%g")
            failed = np.argwhere(np.isnan(values))
            axes.plot(drives[failed[:, 1]], drives[failed[:, 0]], "x", color=marker("ink"))
            for controller, chosen in visited.items():
                shown = chosen[:: max(1, len(chosen) // MAX_VISITED)]
                axes.scatter(
                    shown[:, 1],
                    shown[:, 0],
                    s=5,
                    alpha=0.35,
                    linewidths=0,
                    color=marker(shade[controller]),
                    label=controller,
                )
            axes.set_title(title, loc="left")
            axes.set_xlabel("right drive")
            axes.set_ylabel("left drive")
            axes.set_aspect("equal")
            axes.grid(visible=True)
        handles = figure.axes[0].get_legend_handles_labels()
        if handles[0]:
            figure.legend(*handles, loc="outside lower left", ncols=6, markerscale=3)
        return svg_text(figure, name)


def steering_figure(steering: Steering, name: str) -> str:
    """Left and right drive over the bearing, a panel per policy: mean and range over the starts.

    Parameters
    ----------
    name
        Of the figure, for its ids.
    """
    shown = list(steering.drives.items())[:MAX_STEERING]
    shade = colours(list(steering.drives))
    columns = min(max(len(shown), 2), _STEERING_COLUMNS)
    rows = -(-len(shown) // columns)
    with mpl.rc_context(FRAMED_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 0.5 + 2.4 * rows), layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, (policy, drives) in zip(panels, shown, strict=False):
            for side, (text, line) in enumerate({"left legs": "-", "right legs": "--"}.items()):
                values, look = drives[..., side], {"color": marker(shade[policy])}
                axes.plot(
                    steering.bearings_deg, values.mean(axis=0), linestyle=line, label=text, **look
                )
                axes.fill_between(
                    steering.bearings_deg,
                    values.min(axis=0),
                    values.max(axis=0),
                    alpha=0.15,
                    linewidth=0,
                    **look,
                )
            axes.set_title(policy, loc="left", fontweight="bold")
            axes.set_xticks([-180, -90, 0, 90, 180])
            axes.grid(visible=True)
        for axes in panels[len(shown) :]:
            axes.set_axis_off()
        panels[0].set_ylabel("drive")
        figure.supxlabel("bearing (deg), left positive", fontsize=10, color=marker("muted"))
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
        return svg_text(figure, name)


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
