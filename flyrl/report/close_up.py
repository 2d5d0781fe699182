"""Figures of single walks (gait diagrams, curves over time) and of drives."""

from __future__ import annotations

import io
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS, LEGS
from flyrl.evaluation.drive_map import DriveMap, Steering
from flyrl.evaluation.gait import without_blips
from flyrl.evaluation.metrics import counted_stance
from flyrl.report import style
from flyrl.rollouts import BoolArray, EpisodeRecord
from flyrl.validation import FloatArray, one_of

SHOWN_S: Final = 1.0
"""Part of an episode that a gait diagram shows, s: twelve strides."""

MAX_VISITED: Final = 500
"""Largest number of drives of a policy that are drawn."""

MAX_STEERING: Final = 12
"""Largest number of policies whose steering is drawn."""

_STEERING_COLUMNS: Final = 3

STRIDE_S: Final = 0.1
"""Window over which a speed is taken, s: about a stride, within which the thorax rocks."""


def gait_figure(records: Sequence[EpisodeRecord]) -> Figure:
    """Gait diagrams, one above the other: stance as bars, leg by leg, and what reflexes do.

    Parameters
    ----------
    records
        Of episodes with a log of the gait.
    """
    shade = style.colours(record.controller for record in records)
    height = 0.35 + 1.25 * len(records)
    with style.panels(len(records), 1, height, style.LIST_STYLE, sharex=True) as (figure, every):
        for axes, record in zip(every, records, strict=True):
            gait = record.gait
            assert gait is not None
            leg_bars(axes, counted_stance(record), gait.interval_s, shade[record.controller])
            leg_bars(axes, gait.retraction, gait.interval_s, style.MUTED, (0.36, 0.14))
            leg_bars(axes, gait.stumbling, gait.interval_s, style.INK, (-0.5, 0.14))
            axes.set(title=record.controller, xlim=(0, min(SHOWN_S, record.duration_s)))
            axes.grid(visible=False)
        every[-1].set_xlabel("time (s)")
    return figure


def leg_bars(
    axes: Axes,
    raster: BoolArray,
    interval_s: float,
    shades: str | Sequence[str],
    place: tuple[float, float] = (-0.32, 0.64),
    start_s: float = 0.0,
) -> None:
    """Draw bars where a raster (S, 6) of the legs is true, a row per leg, the first on top.

    Parameters
    ----------
    interval_s, start_s
        Time between two samples, and that of the first, s.
    shades
        Colour of all legs, or of each.
    place
        Upper end and height of the bars around the middle of their row.
    """
    each = [shades] * len(LEGS) if isinstance(shades, str) else shades
    for leg, shade in enumerate(each):
        bars = [(start_s + start, length) for start, length in spans(raster[:, leg], interval_s)]
        axes.broken_barh(bars, (leg + place[0], place[1]), facecolor=shade, linewidth=0)
    axes.set_yticks(range(len(LEGS)), LEGS)
    axes.set_ylim(len(LEGS) - 0.4, -0.6)


def spans(raster: BoolArray, interval_s: float) -> list[tuple[float, float]]:
    """Start and length, s, of each time that a raster (S,) is true."""
    edges = np.flatnonzero(np.diff(raster, prepend=False, append=False)).reshape(-1, 2)
    return [(float(start * interval_s), float((end - start) * interval_s)) for start, end in edges]


def drive_map_figure(
    drive_map: DriveMap, visited: Mapping[str, NDArray[np.floating[Any]]]
) -> Figure:
    """Speed and yaw rate over the drive plane, with the drives that policies chose on top.

    Parameters
    ----------
    visited
        Drives (T, 2) by name of the controller.
    """
    drives, shade = drive_map.drives, style.colours(visited)
    turning = drive_map.yaw_rate_deg_s, drive_map.yaw_rate_error_deg_s
    shown = {
        "speed (mm/s)": (drive_map.speed_mm_s, drive_map.speed_error_mm_s),
        "yaw rate (deg/s), left positive": turning,
    }
    with style.panels(1, 2, 4.2) as (figure, every):
        for axes, (title, (values, errors)) in zip(every, shown.items(), strict=True):
            levels = MaxNLocator(9).tick_values(np.nanmin(values), np.nanmax(values))
            is_noise = errors > np.diff(levels).min()
            sure = np.ma.masked_where(is_noise | np.isnan(values), values)
            lines = axes.contour(drives, drives, sure, levels, colors=style.MUTED, linewidths=1.1)
            axes.clabel(lines, fontsize=8, fmt="%g")
            left, right = np.nonzero(np.isnan(values))
            axes.plot(drives[right], drives[left], "x", color=style.INK)
            for controller, chosen in visited.items():
                left, right = chosen[:: max(1, len(chosen) // MAX_VISITED)].T
                look: Any = {"color": shade[controller], "s": 5, "alpha": 0.35, "linewidths": 0}
                axes.scatter(right, left, label=controller, **look)
            axes.set(title=title, xlabel="right drive", ylabel="left drive", aspect="equal")
        style.add_legend(figure, markerscale=3)
    return figure


def steering_figure(steering: Steering) -> Figure:
    """Left and right drive over the bearing, a panel per policy: mean and range over the starts."""
    shown = list(steering.drives.items())[:MAX_STEERING]
    shade, bearings = style.colours(steering.drives), steering.bearings_deg
    columns = min(max(len(shown), 2), _STEERING_COLUMNS)
    rows = -(-len(shown) // columns)
    height = 0.5 + 2.4 * rows
    with style.panels(rows, columns, height, sharex=True, sharey=True) as (figure, every):
        for axes, (policy, drives) in zip(every, shown, strict=False):
            for side, (text, line) in enumerate({"left legs": "-", "right legs": "--"}.items()):
                values, colour = drives[..., side], shade[policy]
                axes.plot(bearings, values.mean(axis=0), linestyle=line, label=text, color=colour)
                band: Any = {"color": colour, "alpha": 0.15, "linewidth": 0}
                axes.fill_between(bearings, values.min(axis=0), values.max(axis=0), **band)
            axes.set_title(policy, fontweight="bold")
            axes.set_xticks([-180, -90, 0, 90, 180])
        for axes in every[len(shown) :]:
            axes.set_axis_off()
        every[0].set_ylabel("drive")
        figure.supxlabel("bearing (deg), left positive", fontsize=10, color=style.MUTED)
        style.add_legend(figure, ncols=2)
    return figure


def time_figure(records: Sequence[EpisodeRecord], until_s: float) -> Figure:
    """Way, speed and drives (or tensions) over the time of one episode, a line per controller.

    A line that ends with a dot ends with its episode.

    Parameters
    ----------
    records
        Of everyone on the same episode, at least one.
    until_s
        Time at the right end of each panel, s; at the left it is 0.
    """
    shade = style.colours(record.controller for record in records)
    with style.panels(2, 2, 3.9, sharex=True) as (figure, every):
        every[3].sharey(every[2])  # the drives
        drawstyles = ["default", "default", "steps-pre", "steps-pre"]
        for record in records:
            drawn = zip(every, courses(record).items(), drawstyles, strict=True)
            for axes, (title, values), drawstyle in drawn:
                colour = shade[record.controller]
                _line(axes, record, values, until_s, color=colour, drawstyle=drawstyle)
                axes.set_title(title)
        every[0].set_xlim(0, until_s)
        for axes in every[2:]:
            axes.set_xlabel("simulated time (s)")
        style.add_legend(figure)
    return figure


def courses(record: EpisodeRecord) -> dict[str, FloatArray]:
    """Title and values (T,) of each panel; the last two are held up to each sample.

    Of a fly what it is commanded, of a worm what its muscles exert.
    """
    held = held_drive(record)
    way = {"way along +x (mm)": record.position_w[:, 0] - record.position_w[0, 0]}
    if goal := record.episode.goal:
        to_goal = np.linalg.norm(record.position_w[:, :2] - goal, axis=1)
        way = {"distance to the goal (mm)": to_goal}
    commands = (
        {"left drive": held[:, 0], "right drive": held[:, 1]}
        if record.creature == "fly"
        else {"tension of the first muscle": held[:, 0], "mean tension": held.mean(axis=1)}
    )
    return {
        **way,
        f"speed, {STRIDE_S:g} s mean (mm/s)": speed_mm_s(record),
        **commands,
    }


def _line(
    axes: Axes, record: EpisodeRecord, values: FloatArray, until_s: float, **look: Any
) -> None:
    # up to the first sample that is not shown, so that the line reaches the edge
    shown = int(np.searchsorted(record.time_s, until_s)) + 1
    line = axes.plot(record.time_s[:shown], values[:shown], label=record.controller, lw=1.4, **look)
    drawn = np.flatnonzero(np.isfinite(values))
    if record.duration_s <= until_s + 1e-9 and drawn.size:
        end = record.time_s[drawn[-1:]], values[drawn[-1:]]
        axes.plot(*end, "o", color=line[0].get_color(), markersize=4, clip_on=False)


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


SHOWN_JOINTS: Final = ("joint_LFCoxa", "joint_LFFemur", "joint_LFTibia")

_DASHES: Final = ("-", "--", "-.", ":")


class WalkFigure(Figure):
    """A figure of matplotlib that a notebook shows, too, where pyplot was never imported."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=100)
        return buffer.getvalue()


def walk_figure(table: pd.DataFrame, joints: Sequence[str] = SHOWN_JOINTS) -> WalkFigure:
    """Draw a walk.

    Parameters
    ----------
    table
        A row per sample, with the columns of `flyrl.front.walks.Walk.frame`.
    joints
        Whose angles are shown, names in `flyrl.anatomy.JOINTS`; none leaves the panel out.

    Raises
    ------
    ValueError
        There is no such joint.
    """
    for joint in joints:
        one_of("joints", joint, JOINTS)
    time_s = table.time_s.to_numpy()
    interval_s = float(np.mean(np.diff(time_s))) if len(time_s) > 1 else 1e-3
    heights = [1.0, 1.4, 1.0] if joints else [1.0, 1.0]
    size: Any = {"height": 0.6 + 1.4 * sum(heights), "height_ratios": heights}
    with style.panels(len(heights), 1, **size, kind=WalkFigure, sharex=True) as (figure, every):
        speed, *angles, gait = every
        _draw_speed(speed, table, interval_s)
        for axes in angles:
            for joint, dashes in zip(joints, itertools.cycle(_DASHES), strict=False):
                label = joint.removeprefix("joint_")
                axes.plot(
                    time_s, np.degrees(table[joint]), dashes, color=style.INK, lw=1.1, label=label
                )
            axes.set_ylabel("joint angle (°)")
            axes.legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=4, fontsize=7)
        _draw_gait(gait, table, interval_s)
        gait.set_xlim(time_s[0], max(time_s[-1], time_s[0] + 1e-3))
    return cast(WalkFigure, figure)


def _draw_speed(axes: Axes, table: pd.DataFrame, interval_s: float) -> None:
    """Speed over the ground, at every moment and of the mean velocity over a stride."""
    velocity = table[["vx_mm_s", "vy_mm_s"]]
    axes.plot(table.time_s, np.linalg.norm(velocity, axis=1), color=style.LINE, lw=0.8)
    window = max(1, round(STRIDE_S / interval_s))
    mean = velocity.rolling(window, center=True, min_periods=1).mean()
    axes.plot(table.time_s, np.linalg.norm(mean, axis=1), color=style.SHADES[0], lw=1.6)
    axes.set(ylabel=f"speed (mm/s),\nover {STRIDE_S:g} s", ylim=(0.0, None))


def _draw_gait(axes: Axes, table: pd.DataFrame, interval_s: float) -> None:
    """Bars where a leg stands: on the ground, its tip at rest; blips of some ms are left out.

    Thin ones on them where a reflex corrects the leg.
    """
    stands, retracts, stumbles = (
        table[[f"{name}_{leg}" for leg in LEGS]].to_numpy(dtype=bool)
        for name in ("stance", "retracts", "stumbles")
    )
    start_s, corrects = float(table.time_s.iloc[0]), retracts | stumbles
    leg_bars(axes, without_blips(stands, interval_s), interval_s, style.LEG_SHADES, start_s=start_s)
    leg_bars(axes, corrects, interval_s, style.INK, (-0.1, 0.2), start_s)
    note = "; dark: a reflex corrects it" if corrects.any() else ""
    axes.set_xlabel(f"time (s); bars: the leg stands{note}")
    axes.grid(visible=False)
