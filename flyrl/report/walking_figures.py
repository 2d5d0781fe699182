"""Figures of walks made for them: the literature's comparison of leg controllers, gaits, slopes.

After Wang-Chen et al. 2024 (doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flyrl.controllers import CPG
from flyrl.controllers.cpg_controller import Gait
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.evaluation.metrics import counted_stance, episode_metrics, metric_label
from flyrl.policies import ConstantDrive
from flyrl.report.close_up import leg_bars
from flyrl.report.figures import draw_episodes, lists, swarm
from flyrl.report.style import MUTED, SHADES, WIDTH_IN, Plot, colours, outcome_shapes, panels
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
    """Every episode's speed as a dot, with mean and quartiles; a panel per terrain.

    Parameters
    ----------
    episodes
        Of results of an evaluation.
    """
    table = episodes[list(COLUMNS)]
    shades = colours(table["controller"].unique())
    grounds = table.groupby("terrain", sort=False, observed=True)
    with lists(list(shades), grounds.ngroups, sharex=True) as (figure, every):
        for axes, (terrain, walked) in zip(every, grounds, strict=True):
            rows = [walked[walked["controller"] == name] for name in shades]
            draw_episodes(axes, [own[METRIC].to_numpy() for own in rows], rows, [*shades.values()])
            axes.set(title=terrain, xlabel=metric_label(METRIC))
            for dots in axes.collections:
                dots.set_urls([])  # there is no page to lead to
        note = f"an episode: {outcome_shapes(table['outcome'].unique())}"
        figure.supxlabel(note, fontsize=10, color=MUTED)
    return Plot(figure, table)


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
"""Time on level ground, and then on the slope, s."""

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
    with panels(1, 1, 3.6, width=0.7 * WIDTH_IN) as (figure, (axes,)):
        for controller, shade in zip(CONTROLLERS, SHADES, strict=False):
            own = table[table["controller"] == controller]
            axes.plot(own["adhesion_uN"], own["falls_at_deg"], "o", color=shade, ms=3, alpha=0.4)
            medians = own.groupby("adhesion_uN")["falls_at_deg"].median()
            axes.plot(medians.index, medians, color=shade, label=controller)
        axes.plot(*published.values(), "k--", lw=1, label="published median (NMF v2)")
        axes.axhline(90, color=MUTED, lw=0.7)
        axes.text(1, 93, "wall", ha="left", fontsize=8, color=MUTED)
        axes.set_xlabel("adhesion of a gripping leg (µN); the fly weighs 10")
        axes.set(ylabel="slope at which it falls (deg)", ylim=(0, 190), yticks=range(0, 181, 30))
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
"""Part of the gait that is shown, at the end of a walk, s."""


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
    size: Any = {"height": 3.6, "width_ratios": (2, 1)}
    with panels(len(GAITS), 2, **size, sharex="col") as (figure, every):
        drawn = zip(walks.items(), every[::2], every[1::2], SHADES, strict=False)
        for (gait, records), axes, speed, shade in drawn:
            assert records[0].gait is not None
            interval_s = records[0].gait.interval_s
            shown = counted_stance(records[0])[-round(SHOWN_S / interval_s) :]
            leg_bars(axes, shown, interval_s, shade)
            axes.tick_params(axis="y", labelsize=6)
            axes.grid(visible=False)
            axes.set(title=gait, xlim=(0, SHOWN_S))
            values = table[METRIC][table["gait"] == gait].to_numpy()
            speed.plot(values, swarm(values), "o", color=shade, ms=4)
            speed.set(ylim=(-0.5, 0.5), yticks=[])
        axes.set_xlabel("time (s); bars: the leg stands")
        speed.set(xlabel=metric_label(METRIC), xlim=(0.0, None))
    return Plot(figure, table)


def _walks(gait: Gait) -> list[EpisodeRecord]:
    task = {"name": "traverse", "drive_time_constant": 0}  # as in `STUDY`
    config = EnvConfig(task, controller=CPG(gait=gait), log_gait=True)
    env = BatchedEnv(config, FLIES)
    ahead = ConstantDrive(1.0, 1.0, env.task)
    episodes = [config.sample_episode(seed) for seed in range(FLIES)]
    return list(run_episodes(env, ahead, episodes, horizon_s=DURATION_S))
