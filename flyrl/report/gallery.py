"""The figures of the literature, drawn anew, each with the numbers that it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from flyrl.files import write_text
from flyrl.muscles import MotorPool
from flyrl.report.muscle_figure import muscle_figure
from flyrl.report.standalone import standalone
from flyrl.report.worm_video import film_worm, write_worm_video
from flyrl.resources import assets_folder


def _muscle(folder: Path) -> None:
    profile = assets_folder() / "muscles" / "human.png"
    pool = MotorPool.from_image(profile)
    table = pd.DataFrame(
        {"n": np.arange(len(pool)), "force": pool.forces, "tension": pool.recruitment}
    )
    write_text(folder / "muscle.svg", standalone(muscle_figure(profile)))
    write_text(folder / "muscle.csv", table.to_csv(index=False, float_format="%.6g"))


def _worm(folder: Path) -> None:
    write_worm_video(film_worm(), folder)


GALLERY: Final[Mapping[str, Callable[[Path], None]]] = {"muscle": _muscle, "worm": _worm}
"""What writes each figure into a folder, by the figure's name, which its files begin with.

A figure that cannot be drawn on this machine raises `RenderingUnavailableError`, RuntimeError or
OSError.
"""
