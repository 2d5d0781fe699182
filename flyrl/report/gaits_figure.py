"""Three gaits of the CPG: which legs stand when, and how fast they carry the fly."""

from __future__ import annotations

from typing import Final, get_args

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flyrl.anatomy import LEGS
from flyrl.controllers import CPG
from flyrl.controllers.cpg_controller import Gait
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.metrics import counted_stance, episode_metrics
from flyrl.policies import ConstantDrive
from flyrl.report.close_up import spans
from flyrl.report.figures import METRIC_LABELS, swarm
from flyrl.report.paper import PAPER_STYLE, Plot, light
from flyrl.report.style import WIDTH_IN
from flyrl.rollouts import EpisodeRecord, run_episodes

GAITS: Final[tuple[Gait, ...]] = get_args(Gait)

FLIES: Final = 16
DURATION_S: Final = 1.5
SHOWN_S: Final = 0.6
"""Of the gait, at the end of a walk, s."""

METRIC: Final = "speed_mm_s"


def gaits_plot() -> Plot:
    """Walk straight ahead on flat ground in each gait.

    Returns
    -------
    The figure, and a table with a row per fly: "gait", "episode" and "speed_mm_s".
    """
    walks = {gait: _walks(gait) for gait in GAITS}
    speeds = {
        gait: np.array([float(episode_metrics(each)[METRIC] or 0.0) for each in records])
        for gait, records in walks.items()
    }
    with mpl.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
        grid = figure.add_gridspec(len(GAITS), 2, width_ratios=(2, 1))
        for row, (gait, records) in enumerate(walks.items()):
            axes = figure.add_subplot(grid[row, 0])
            _raster(axes, records[0], light(f"c{row}"))
            axes.set_title(gait, loc="left")
            axes.tick_params(labelbottom=row == len(GAITS) - 1)
        axes.set_xlabel("time (s); bars: the leg stands")
        panel = figure.add_subplot(grid[:, 1])
        for place, values in enumerate(speeds.values()):
            panel.plot(place + swarm(values, 12), values, "o", color=light(f"c{place}"), ms=4)
        panel.set_xticks(range(len(GAITS)), GAITS)
        panel.set_xlim(-0.6, len(GAITS) - 0.4)
        panel.set_ylim(bottom=0.0)
        panel.set_ylabel(METRIC_LABELS[METRIC])
        panel.grid(visible=False, axis="x")
    table = pd.DataFrame(
        [
            {"gait": gait, "episode": episode, METRIC: value}
            for gait, values in speeds.items()
            for episode, value in enumerate(values.tolist())
        ]
    )
    return Plot(figure, table)


def _walks(gait: Gait) -> list[EpisodeRecord]:
    config = EnvConfig("traverse", controller=CPG(gait=gait), log_gait=True)
    env = BatchedEnv(config, FLIES)
    ahead = ConstantDrive(1.0, 1.0, env.task.actions.of)
    episodes = [config.sample_episode(seed) for seed in range(FLIES)]
    return list(run_episodes(env, ahead, episodes, horizon_s=DURATION_S))


def _raster(axes: Axes, record: EpisodeRecord, shade: str) -> None:
    """Bars where a leg stands, over the end of a walk."""
    assert record.gait is not None
    stance, interval_s = counted_stance(record), record.gait.interval_s
    shown = stance[-round(SHOWN_S / interval_s) :]
    for leg in range(len(LEGS)):
        axes.broken_barh(
            spans(shown[:, leg], interval_s), (leg - 0.32, 0.64), facecolor=shade, linewidth=0
        )
    axes.set_yticks(range(len(LEGS)), LEGS, fontsize=6)
    axes.set_ylim(len(LEGS) - 0.4, -0.6)
    axes.set_xlim(0, SHOWN_S)
    axes.grid(visible=False)
