"""The figures and videos of the literature, drawn anew, each with the numbers that it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from PIL import Image

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.files import write_bytes, write_text
from flyrl.muscles import MotorPool
from flyrl.report import controller_figures as controllers
from flyrl.report.curves import save_figure
from flyrl.report.style import SHADES, WIDTH_IN, Plot, panels
from flyrl.report.walk_videos import WALKS, Film, film_worm
from flyrl.report.walking_figures import comparison_plot, gaits_plot, slopes_plot
from flyrl.resources import assets_folder
from flyrl.simulation.rendering import FlyRenderer
from flyrl.terrains import LITERATURE
from flyrl.text import csv_table


def terrains_plot() -> Plot:
    """The four terrains, with a fly on each.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """
    rows = []
    with panels(2, 2, 7.4) as (figure, every):
        for axes, name in zip(every, LITERATURE, strict=True):
            env = BatchedEnv(EnvConfig("hybrid_turning", terrain=name), 1, 1)
            scene = env.config.fly_scene
            env.reset(seeds=[0])
            env.flies.step(round(0.1 / scene.physics.timestep))
            with closing(FlyRenderer(scene)) as renderer:
                axes.imshow(renderer.render(env.flies))
            axes.set_axis_off()
            axes.set_title(name)
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
    size: Any = {"width": 0.7 * WIDTH_IN, "height_ratios": (0.16, 0.7, 1.0), "sharex": True}
    with panels(3, 1, 3.9, **size) as (figure, (strip, forces, curve)):
        strip.imshow(row, aspect="auto", extent=(-0.5, len(pool) - 0.5, 0, 1))
        strip.set_yticks([])
        strip.set_title(f"{profile.name}: a pixel per motor neuron")
        forces.fill_between(n, pool.forces, step="mid", color=SHADES[1], linewidth=0)
        forces.set(ylabel="255 - blue", ylim=(0, 265))
        curve.step(n, pool.recruitment, where="post", color=SHADES[1])
        curve.set(ylabel="tension", ylim=(0, 1.04))
        curve.set(xlabel="recruited up to motor neuron n", xlim=(-0.5, len(pool) - 0.5))
        strip.grid(visible=False)
    table = pd.DataFrame({"n": n, "force": pool.forces, "tension": pool.recruitment})
    return Plot(figure, table)


GALLERY: Final[Mapping[str, Callable[[], Plot | Film]]] = {
    "cpg_three": controllers.three_oscillators_plot,
    "cpg_tripod": controllers.tripod_plot,
    "steps": controllers.steps_plot,
    "steps_magnitude": partial(controllers.steps_plot, ramps=True),
    "adhesion": controllers.adhesion_plot,
    "rules_graph": controllers.rules_graph_plot,
    "rules": controllers.rules_plot,
    "terrains": terrains_plot,
    "turn": controllers.turn_plot,
    "gaits": gaits_plot,
    "slopes": slopes_plot,
    "comparison": comparison_plot,
    "muscle": partial(muscle_plot, assets_folder() / "muscles" / "human.png"),
    **WALKS,
    "worm": film_worm,
}
"""Function that draws or films each figure of the gallery."""


def write(drawn: Plot | Film, folder: Path, name: str) -> None:
    """Write name.svg and name.png, or name.mp4 and name.jpg, and name.csv to a folder.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    if isinstance(drawn, Film):
        write_bytes(folder / f"{name}.mp4", drawn.mp4)
        write_bytes(folder / f"{name}.jpg", drawn.poster)
    else:
        save_figure(drawn.figure, folder, name)
    write_text(folder / f"{name}.csv", csv_table(drawn.table, float_format="%.6g"))
