"""How steep a slope a fly can walk up, by how hard its feet hold on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.report.paper import PAPER_STYLE, Plot, light
from flyrl.report.style import WIDTH_IN
from flyrl.simulation.randomisation import Randomisation
from flyrl.terrains import Ground, Slope

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
    tables = []
    for controller in CONTROLLERS:
        falls_at = falling_slopes(controller)
        tables.append(
            pd.DataFrame(
                {
                    "controller": controller,
                    "adhesion_uN": np.repeat(list(PUBLISHED), STARTS),
                    "start": np.tile(range(STARTS), len(PUBLISHED)),
                    "falls_at_deg": falls_at.ravel(),
                }
            )
        )
    published = {"adhesion_uN": list(PUBLISHED), "falls_at_deg": list(PUBLISHED.values())}
    table = pd.concat([*tables, pd.DataFrame({"controller": "published median", **published})])
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(0.7 * WIDTH_IN, 3.6), layout="constrained")
        axes = figure.subplots()
        for place, controller in enumerate(CONTROLLERS):
            own = table[table["controller"] == controller]
            shade = light(f"c{place}")
            axes.plot(own["adhesion_uN"], own["falls_at_deg"], "o", color=shade, ms=3, alpha=0.4)
            medians = own.groupby("adhesion_uN")["falls_at_deg"].median()
            axes.plot(medians.index, medians, color=shade, label=controller)
        axes.plot(
            *zip(*PUBLISHED.items(), strict=True), "k--", lw=1, label="published median (NMF v2)"
        )
        axes.axhline(90, color=light("muted"), lw=0.7)
        axes.text(1, 93, "wall", ha="left", fontsize=8, color=light("muted"))
        axes.set_xlabel("adhesion of a gripping leg (µN); the fly weighs 10")
        axes.set_ylabel("slope at which it falls (deg)")
        axes.set_ylim(0, 190)
        axes.set_yticks(range(0, 181, 30))
        axes.legend(loc="upper left")
    return Plot(figure, table)


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
