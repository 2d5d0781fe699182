"""Figures of walks made for them: the literature's comparison of leg controllers, gaits, slopes.

After Wang-Chen et al. 2024 (doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, get_args

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from flyrl.controllers import CPG
from flyrl.controllers.cpg_controller import Gait
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.evaluation.metrics import counted_stance, episode_metrics, metric_label
from flyrl.policies import ConstantDrive
from flyrl.report.close_up import leg_bars
from flyrl.report.figures import swarm
from flyrl.report.style import (
    INK,
    MUTED,
    PAPER_STYLE,
    SHADES,
    WIDTH_IN,
    Plot,
    colours,
    outcome_dot,
    panels,
)
from flyrl.report.wording import outcome_name
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.simulation.randomisation import Randomisation
from flyrl.terrains import LITERATURE, Ground, Slope

STUDY: Final = EvaluationConfig(
    # at full drive from the start: a speed is the controller's, not that of a drive that grows
    task={"name": "traverse", "time_limit": 1.5, "drive_time_constant": 0},
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
    shades = colours(table["controller"].unique())
    terrains = list(table["terrain"].unique())
    highest = float(table[METRIC].max())
    with panels(1, len(terrains), 3.6, PAPER_STYLE, sharey=True) as (figure, every):
        for axes, terrain in zip(every, terrains, strict=True):
            for place, (name, shade) in enumerate(shades.items()):
                chosen = (table["terrain"] == terrain) & (table["controller"] == name)
                _dots(axes, table[chosen], place, shade, highest)
            axes.set_title(terrain, loc="left")
            axes.set_xticks(range(len(shades)), [name.replace("_", "-") for name in shades])
            axes.set_xlim(-0.6, len(shades) - 0.4)
            axes.grid(visible=False, axis="x")
        every[0].set_ylabel(metric_label(METRIC))
        every[0].set_ylim(bottom=min(0.0, table[METRIC].min()))
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
    axes.plot([place - 0.36, place + 0.36], [mean, mean], color=INK, linewidth=2)


def _legend(rows: pd.DataFrame) -> list[Line2D]:
    """What dots and lines mean."""
    handles = [Line2D([], [], color=INK, linewidth=2, label="mean")]
    for outcome in rows["outcome"].unique():
        dot = outcome_dot(outcome, MUTED)
        look: Any = {"linestyle": "", "marker": dot["marker"], "markersize": 5, "color": MUTED}
        look["markerfacecolor"] = dot.get("facecolors", MUTED)
        handles.insert(-1, Line2D([], [], label=f"an episode: {outcome_name(outcome)}", **look))
    return handles


PUBLISHED: Final = {
    0: 30, 5: 35, 10: 40, 15: 55, 20: 60, 25: 90, 30: 75, 35: 85, 40: 95, 45: 100, 50: 85, 55: 100,
    60: 80,
}  # fmt: skip
"""Adhesion, µN -> median slope at which the fly falls, degrees: NeuroMechFly v2, from the data of
github.com/NeLy-EPFL/nmf2-paper, `leg_adhesion`."""

CONTROLLERS: Final = ("hybrid", "cpg")
STARTS: Final = 4
STEP_DEG: Final = 5

LEVEL_S: Final = 0.4
SLOPE_S: Final = 1.0
"""How long the fly walks on level ground, and then on the slope."""

_DECISION_S: Final = 0.02


def slopes_plot() -> Plot:
    """Turn gravity under walking flies, and find the slope at which they fall.

    Returns
    -------
    The figure, and a table with a row per fly: "controller", "adhesion_uN", "start" and
    "falls_at_deg" (beyond 180: it holds on to a ceiling); the published medians have no start.
    """
    published = {"adhesion_uN": list(PUBLISHED), "falls_at_deg": list(PUBLISHED.values())}
    table = pd.concat(
        [
            *(_slopes_table(controller) for controller in CONTROLLERS),
            pd.DataFrame({"controller": "published median", **published}),
        ]
    )
    with panels(1, 1, 3.6, PAPER_STYLE, width=0.7 * WIDTH_IN) as (figure, (axes,)):
        for controller, shade in zip(CONTROLLERS, SHADES, strict=False):
            own = table[table["controller"] == controller]
            axes.plot(own["adhesion_uN"], own["falls_at_deg"], "o", color=shade, ms=3, alpha=0.4)
            medians = own.groupby("adhesion_uN")["falls_at_deg"].median()
            axes.plot(medians.index, medians, color=shade, label=controller)
        axes.plot(*published.values(), "k--", lw=1, label="published median (NMF v2)")
        axes.axhline(90, color=MUTED, lw=0.7)
        axes.text(1, 93, "wall", ha="left", fontsize=8, color=MUTED)
        axes.set_xlabel("adhesion of a gripping leg (µN); the fly weighs 10")
        axes.set_ylabel("slope at which it falls (deg)")
        axes.set_ylim(0, 190)
        axes.set_yticks(range(0, 181, 30))
        axes.legend(loc="upper left")
    return Plot(figure, table)


def _slopes_table(controller: str) -> pd.DataFrame:
    """A row per fly, see `slopes_plot`."""
    columns = {
        "adhesion_uN": np.repeat(list(PUBLISHED), STARTS),
        "start": np.tile(range(STARTS), len(PUBLISHED)),
        "falls_at_deg": falling_slopes(controller).ravel(),
    }
    return pd.DataFrame({"controller": controller, **columns})


def falling_slopes(controller: str) -> NDArray[np.float64]:
    """Least slope at which a fly falls, degrees, (adhesions of `PUBLISHED`, starts).

    Slopes are bisected, as if a fly that falls on one fell on every steeper one; a fly that falls
    on none has 180 + STEP_DEG.
    """
    config = EnvConfig(
        "hybrid_turning",
        controller=controller,
        terrain=Slope(angle_range_deg=(0, 180), random=True),
        decision_interval=_DECISION_S,
    )
    usual = config.fly_scene.body.adhesion_gain
    num_flies = len(PUBLISHED) * STARTS
    env = BatchedEnv(config, num_flies)
    episodes = [
        replace(
            config.sample_episode(start, difficulty=0.0),  # level ground
            randomisation=Randomisation(adhesion=adhesion / usual),
        )
        for adhesion in PUBLISHED
        for start in range(STARTS)
    ]
    holds = np.zeros(num_flies, dtype=np.int64)
    falls = np.full(num_flies, 180 // STEP_DEG + 1)
    while (falls - holds > 1).any():
        tried = (holds + falls) // 2
        env.reset(episodes=episodes)
        angles = (STEP_DEG * tried).tolist()
        slopes = [Slope(angle_range_deg=(angle, angle)) for angle in angles]
        has_fallen = _walk(env, [slope.draw(slope.seed) for slope in slopes])
        falls = np.where(has_fallen, tried, falls)
        holds = np.where(has_fallen, holds, tried)
    return (STEP_DEG * falls).astype(np.float64).reshape(-1, STARTS)


def _walk(env: BatchedEnv, slopes: Sequence[Ground]) -> NDArray[np.bool_]:
    """Walk on level ground, then up a slope each; which flies fell, (n,)."""
    ahead = np.ones((env.num_envs, 2))
    for _ in range(round(LEVEL_S / _DECISION_S)):
        env.step(ahead)
    env.flies.set_ground(np.arange(env.num_envs), slopes)
    has_fallen = np.zeros(env.num_envs, dtype=bool)
    for _ in range(round(SLOPE_S / _DECISION_S)):
        still = np.flatnonzero(~has_fallen)
        if not len(still):
            break
        has_fallen[still] |= env.step(ahead, still).terminated[still]
    return has_fallen


GAITS: Final[tuple[Gait, ...]] = get_args(Gait)

FLIES: Final = 16
DURATION_S: Final = 1.5
SHOWN_S: Final = 0.6
"""Of the gait, at the end of a walk, s."""


def gaits_plot() -> Plot:
    """Walk straight ahead on flat ground in each gait.

    Returns
    -------
    The figure, and a table with a row per fly: "gait", "episode" and "speed_mm_s".
    """
    walks = {gait: _walks(gait) for gait in GAITS}
    table = pd.DataFrame(
        [
            {"gait": gait, "episode": episode, METRIC: episode_metrics(record)[METRIC] or 0.0}
            for gait, records in walks.items()
            for episode, record in enumerate(records)
        ]
    )
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
        grid = figure.add_gridspec(len(GAITS), 2, width_ratios=(2, 1))
        speed = figure.add_subplot(grid[:, 1])
        for place, (gait, records) in enumerate(walks.items()):
            axes, record = figure.add_subplot(grid[place, 0]), records[0]
            assert record.gait is not None
            interval_s = record.gait.interval_s
            shown = counted_stance(record)[-round(SHOWN_S / interval_s) :]
            leg_bars(axes, shown, interval_s, SHADES[place])
            axes.tick_params(axis="y", labelsize=6)
            axes.set_xlim(0, SHOWN_S)
            axes.grid(visible=False)
            axes.set_title(gait, loc="left")
            axes.tick_params(labelbottom=place == len(GAITS) - 1)
            values = table[METRIC][table["gait"] == gait].to_numpy()
            speed.plot(place + swarm(values, 12), values, "o", color=SHADES[place], ms=4)
        axes.set_xlabel("time (s); bars: the leg stands")
        speed.set_xticks(range(len(GAITS)), GAITS)
        speed.set_xlim(-0.6, len(GAITS) - 0.4)
        speed.set_ylim(bottom=0.0)
        speed.set_ylabel(metric_label(METRIC))
        speed.grid(visible=False, axis="x")
    return Plot(figure, table)


def _walks(gait: Gait) -> list[EpisodeRecord]:
    task = {"name": "traverse", "drive_time_constant": 0}  # as in `STUDY`
    config = EnvConfig(task, controller=CPG(gait=gait), log_gait=True)
    env = BatchedEnv(config, FLIES)
    ahead = ConstantDrive(1.0, 1.0, env.task)
    episodes = [config.sample_episode(seed) for seed in range(FLIES)]
    return list(run_episodes(env, ahead, episodes, horizon_s=DURATION_S))
