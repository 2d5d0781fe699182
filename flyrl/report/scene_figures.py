"""Figures of the fly in its world, of a muscle, and of one walk over time."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from flyrl.anatomy import JOINTS, LEGS
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.gait import without_blips
from flyrl.muscles import MotorPool
from flyrl.report.close_up import STRIDE_S, spans
from flyrl.report.style import LEG_COLOURS, PAPER_STYLE, WIDTH_IN, Plot, light
from flyrl.simulation.rendering import FlyRenderer
from flyrl.terrains import LITERATURE
from flyrl.validation import one_of


def terrains_plot() -> Plot:
    """The four terrains, with a fly on each.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """
    rows = []
    with mpl.rc_context({**PAPER_STYLE, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH_IN, 7.4), layout="constrained")
        for axes, name in zip(figure.subplots(2, 2).ravel(), LITERATURE, strict=True):
            env = BatchedEnv(EnvConfig("hybrid_turning", terrain=name), 1, 1)
            scene = env.config.fly_scene
            env.reset(seeds=[0])
            env.flies.step(round(0.1 / scene.physics.timestep))
            with closing(FlyRenderer(scene)) as renderer:
                axes.imshow(renderer.render(env.flies))
            axes.set_axis_off()
            axes.set_title(name, loc="left")
            tops = scene.terrain.compiled().boxes.tops
            lowest, highest = (tops.min(), tops.max()) if tops.size else (0.0, 0.0)
            rows.append((name, tops.size, lowest, highest))
    table = pd.DataFrame(rows, columns=["terrain", "boxes", "lowest_top_mm", "highest_top_mm"])
    return Plot(figure, table)


def muscle_plot(profile: Path | str) -> Plot:
    """Draw a profile image, the forces it stands for, and tension over recruitment.

    After cortex, Simulated Muscles, R. McIntyre (2012-14).

    Parameters
    ----------
    profile
        Image of a motor pool, see `MotorPool.from_image`.

    Raises
    ------
    FileNotFoundError, ValueError
        If it is not one.
    """
    profile = Path(profile)
    pool = MotorPool.from_image(profile)
    with Image.open(profile) as image:
        row = np.asarray(image.crop((0, 0, image.width, 1)).convert("RGBA").convert("RGB"))
    n = np.arange(len(pool))
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(0.7 * WIDTH_IN, 3.9), layout="constrained")
        strip, forces, curve = figure.subplots(3, 1, sharex=True, height_ratios=(0.16, 0.7, 1.0))
        strip.imshow(row, aspect="auto", extent=(-0.5, len(pool) - 0.5, 0, 1))
        strip.set_yticks([])
        strip.set_title(f"{profile.name}: a pixel per motor neuron", loc="left")
        forces.fill_between(n, pool.forces, step="mid", color=light("c1"), linewidth=0)
        forces.set_ylabel("255 - blue")
        forces.set_ylim(0, 265)
        curve.step(n, pool.recruitment, where="post", color=light("c1"))
        curve.set_ylabel("tension")
        curve.set_ylim(0, 1.04)
        curve.set_xlim(-0.5, len(pool) - 0.5)
        curve.set_xlabel("recruited up to motor neuron n")
        strip.grid(visible=False)
    table = pd.DataFrame({"n": n, "force": pool.forces, "tension": pool.recruitment})
    return Plot(figure, table)


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
    with mpl.rc_context(PAPER_STYLE):
        heights = [1.0, 1.4, 1.0] if joints else [1.0, 1.0]
        figure = WalkFigure(figsize=(WIDTH_IN, 0.6 + 1.4 * sum(heights)), layout="constrained")
        panels = figure.subplots(len(heights), sharex=True, height_ratios=heights)
        _draw_speed(panels[0], table, time_s)
        if joints:
            _draw_joints(panels[1], table[list(joints)], time_s)
        _draw_gait(panels[-1], table, time_s)
        panels[-1].set_xlim(time_s[0], max(time_s[-1], time_s[0] + 1e-3))
    return figure


def _draw_speed(axes: Axes, table: pd.DataFrame, time_s: NDArray[np.float64]) -> None:
    """Speed over the ground, at every moment and of the mean velocity over a stride."""
    velocity = table[["vx_mm_s", "vy_mm_s"]]
    axes.plot(time_s, np.linalg.norm(velocity, axis=1), color=light("line"), lw=0.8)
    window = max(1, round(STRIDE_S / _interval_s(time_s)))
    mean = velocity.rolling(window, center=True, min_periods=1).mean()
    axes.plot(time_s, np.linalg.norm(mean, axis=1), color=light("c0"), lw=1.6)
    axes.set_ylabel(f"speed (mm/s),\nover {STRIDE_S:g} s")
    axes.set_ylim(bottom=0.0)


def _draw_joints(axes: Axes, angles: pd.DataFrame, time_s: NDArray[np.float64]) -> None:
    """A line per joint."""
    for joint, dashes in zip(angles, itertools.cycle(_DASHES), strict=False):
        label = str(joint).removeprefix("joint_")
        degrees = np.degrees(angles[joint])
        axes.plot(time_s, degrees, dashes, color=light("ink"), lw=1.1, label=label)
    axes.set_ylabel("joint angle (°)")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=4, fontsize=7)


def _draw_gait(axes: Axes, table: pd.DataFrame, time_s: NDArray[np.float64]) -> None:
    """Bars where a leg stands: on the ground, its tip at rest; blips of some ms are left out.

    Thin ones on them where a reflex corrects the leg.
    """
    interval_s = _interval_s(time_s)
    stands, retracts, stumbles = (
        table[[f"{name}_{leg}" for leg in LEGS]].to_numpy(dtype=bool)
        for name in ("stance", "retracts", "stumbles")
    )
    raster = without_blips(stands, interval_s)
    for place, name in enumerate(LEG_COLOURS):
        for shown, height, colour in (
            (raster, 0.64, light(name)),
            (retracts | stumbles, 0.2, light("ink")),
        ):
            bars = [(time_s[0] + start, size) for start, size in spans(shown[:, place], interval_s)]
            axes.broken_barh(bars, (place - height / 2, height), facecolor=colour, linewidth=0)
    note = "; dark: a reflex corrects it" if (retracts | stumbles).any() else ""
    axes.set_xlabel(f"time (s); bars: the leg stands{note}")
    axes.set_yticks(range(len(LEGS)), LEGS)
    axes.set_ylim(len(LEGS) - 0.4, -0.6)
    axes.grid(visible=False)


def _interval_s(time_s: NDArray[np.float64]) -> float:
    return float(np.mean(np.diff(time_s))) if len(time_s) > 1 else 1e-3
