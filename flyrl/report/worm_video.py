"""The literature's demonstration of muscles: a hanging worm recruits one, and bends.

After cortex, Simulated Muscles, R. McIntyre (2012-14): the worm's top segment is fixed, and a bar
in the lower right corner fills with red in proportion to tension.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
import pandas as pd
from PIL import Image, ImageDraw, ImageFont

from flyrl.bodies.worm import DEMONSTRATION, WormConfig, build_worm
from flyrl.files import write_bytes, write_text
from flyrl.muscles import load_creature
from flyrl.report.tension_bars import tension_bars
from flyrl.report.video import FPS, HOLD_FRAMES, Picture, encode
from flyrl.simulation.recruitment import STEP, Moment, recruit_stepwise
from flyrl.simulation.rendering import Offscreen
from flyrl.simulation.worm_scenery import add_surroundings, side_view

WIDTH: Final = 640
HEIGHT: Final = 480

HOLD_S: Final = 1.0
"""For how long every number of neurons is held, s: the worm has settled then."""


@dataclass(frozen=True)
class WormVideo:
    """The demonstration.

    Attributes
    ----------
    mp4
        The file: H.264, yuv420p, in real time.
    table
        A row per number of neurons: `n`; `tension`, within 0 and 1; `bend_deg`, the sum of all
        joints' angles in the end.
    """

    mp4: bytes
    table: pd.DataFrame


def film_worm(
    config: WormConfig = DEMONSTRATION, step: int = STEP, hold_s: float = HOLD_S
) -> WormVideo:
    """Film a worm while more and more neurons of its muscle are recruited.

    Parameters
    ----------
    config
        The worm; by default the literature's.
    step
        Neurons that are recruited at a time.
    hold_s
        For how long every number of them is held, s.

    Raises
    ------
    ValueError
        If the worm has more than one muscle.
    RenderingUnavailableError
        If no GL context can be made.
    OSError, RuntimeError
        If ffmpeg fails.
    """
    if config.muscles != "one":
        raise ValueError(f"the filmed worm must have muscles='one', got {config.muscles!r}")
    spec = build_worm(config)
    add_surroundings(spec)
    creature = load_creature(spec)
    pictures: list[Picture] = []
    rows = []
    with _offscreen(creature.model) as offscreen:
        camera = side_view(config)
        for moment in recruit_stepwise(creature, step, hold_s, 1 / FPS):
            mujoco.mj_camlight(creature.model, creature.data)
            pictures.append(_annotated(offscreen.draw(creature.data, camera), moment))
            if moment.is_last:
                rows.append((moment.n, moment.tension[0], np.degrees(moment.bend)))
    table = pd.DataFrame(rows, columns=["n", "tension", "bend_deg"])
    return WormVideo(encode(pictures + pictures[-1:] * HOLD_FRAMES), table)


def write_worm_video(video: WormVideo, folder: Path) -> None:
    """Write worm.mp4 and worm.csv, the table, to a folder, made if missing."""
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / "worm.mp4", video.mp4)
    write_text(folder / "worm.csv", video.table.to_csv(index=False, float_format="%.6g"))


def _annotated(picture: Picture, moment: Moment) -> Picture:
    """Write what is recruited, the tension and the bend onto a picture, and draw the bar."""
    image = Image.fromarray(tension_bars(picture, moment.tension))
    draw = ImageDraw.Draw(image, "RGBA")
    lines = [
        (f"neurons up to {moment.n}", 22.0),
        (f"tension {moment.tension[0]:.2f}   bend {np.degrees(moment.bend):.0f}°", 15.0),
    ]
    fonts = [ImageFont.load_default(size) for _, size in lines]
    draw.rectangle((10, 10, 236, 68), fill=(10, 14, 20, 150))
    for (text, size), font, y in zip(lines, fonts, (15, 43), strict=True):
        shade = (255, 255, 255, 255) if size > 20 else (205, 212, 220, 255)
        draw.text((22, y), text, fill=shade, font=font)
    return np.asarray(image)


@contextmanager
def _offscreen(model: mujoco.MjModel) -> Iterator[Offscreen]:
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    offscreen = Offscreen(model, WIDTH, HEIGHT)
    try:
        yield offscreen
    finally:
        offscreen.close()
