"""Figure of a muscle: the profile of its motor pool, and its recruitment curve."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from PIL import Image

from flyrl.muscles import MotorPool
from flyrl.report.paper import PAPER_STYLE, Plot, light
from flyrl.report.style import WIDTH_IN


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
