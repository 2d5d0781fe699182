"""The literature's demonstration of muscles: a worm in mid air recruits one, and bends.

After cortex, Simulated Muscles, R. McIntyre (2012-14): the worm is suspended without gravity, its
lowest segment held in place, and a bar in the lower right corner fills with red in
proportion to tension.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import mujoco
import numpy as np
import pandas as pd

from flyrl.bodies.worm import DEMONSTRATION, WormConfig, build_worm
from flyrl.muscles import load_creature
from flyrl.report.captions import Picture, titled
from flyrl.report.film import Film, jpeg
from flyrl.report.tension_bars import tension_bars
from flyrl.report.video import FPS, HOLD_FRAMES, encode
from flyrl.simulation.recruitment import STEP, Moment, recruit_stepwise
from flyrl.simulation.rendering import Offscreen
from flyrl.simulation.worms import add_surroundings, side_view

WIDTH: Final = 640
HEIGHT: Final = 480

HOLD_S: Final = 1.0
"""For how long every number of neurons is held, s: the worm has settled then."""


def film_worm(config: WormConfig = DEMONSTRATION, step: int = STEP, hold_s: float = HOLD_S) -> Film:
    """Film a worm while more and more neurons of its muscle are recruited.

    Parameters
    ----------
    config
        The worm; by default the literature's.
    step
        Neurons that are recruited at a time.
    hold_s
        For how long every number of them is held, s.

    Returns
    -------
    The video, in real time, and a table with a row per number of neurons: `n`; `tension`, within 0
    and 1; `bend_deg`, the sum of all joints' angles in the end.

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
    creature = load_creature(spec, config.profile_path.parent)
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
    mp4 = encode(pictures + pictures[-1:] * HOLD_FRAMES)
    return Film(mp4, jpeg(pictures[-1]), table)


def _annotated(picture: Picture, moment: Moment) -> Picture:
    """Write what is recruited, the tension and the bend onto a picture, and draw the bar."""
    text = f"tension {moment.tension[0]:.2f}   bend {np.degrees(moment.bend):.0f}°   real time"
    picture = tension_bars(picture, moment.tension)
    return titled(picture, f"neurons up to {moment.n}", text)


@contextmanager
def _offscreen(model: mujoco.MjModel) -> Iterator[Offscreen]:
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    offscreen = Offscreen(model, WIDTH, HEIGHT)
    try:
        yield offscreen
    finally:
        offscreen.close()
