"""The literature's figures of the fly in its world."""

from __future__ import annotations

from contextlib import closing

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.report.paper import PAPER_STYLE, Plot
from flyrl.report.style import WIDTH_IN
from flyrl.simulation.rendering import FlyRenderer
from flyrl.terrains import LITERATURE


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
