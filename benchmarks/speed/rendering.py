"""Pictures per second of a walking fly, everything drawn that videos can show."""

import time
from collections.abc import Sequence
from contextlib import closing
from itertools import product
from typing import Final

import numpy as np
from tqdm import tqdm

from benchmarks.speed.results import Row, significant
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.report.captions import clock_text, titled
from flyrl.report.video import measured
from flyrl.simulation.marks import Overlay
from flyrl.simulation.rendering import Camera, FlyRenderer, RenderingUnavailableError

SIZE: Final = (640, 480)
CAMERAS: Final[tuple[Camera, ...]] = ("follow", "top")
FRAME_S: Final = 0.01
"""s of simulated time between two pictures."""

WARM_UP: Final = 5
"""Pictures before any is timed."""


def measure(terrains: Sequence[str], pictures: int = 60) -> list[Row]:
    """One row per terrain and camera: a fly walks, and only its pictures are timed.

    Parameters
    ----------
    terrains
        Names.
    pictures
        How many are timed for each row.

    Returns
    -------
    Each with the median picture's rate and wall time, and the processor time of all threads. Where
    nothing can be drawn, a single row says so.
    """
    cells = tqdm(list(product(terrains, CAMERAS)), desc="rendering")
    try:
        return [_measure(terrain, camera, pictures) for terrain, camera in cells]
    except RenderingUnavailableError as error:
        return [{"note": f"not measured: {error}"}]


def _measure(terrain: str, camera: Camera, pictures: int) -> Row:
    env = BatchedEnv(EnvConfig("hybrid_turning", terrain=terrain), 1, 1)
    env.reset(seeds=[0])
    flies, scene = env.flies, env.config.fly_scene
    flies.set_command(np.ones((1, 2)))
    wall, processor = [], []
    overlay = Overlay(forces=True)
    with closing(FlyRenderer(scene, *SIZE, camera, overlay)) as renderer:
        for picture in range(WARM_UP + pictures):
            flies.step(round(FRAME_S / scene.physics.timestep))
            began, spent = time.perf_counter(), time.process_time()
            drawn = renderer.render(flies, 0, (12.0, 0.0))
            drawn = measured(drawn, renderer.pixels_per_mm, overlay)
            titled(drawn, "hybrid", clock_text(picture * FRAME_S, 1.0))
            if picture >= WARM_UP:
                wall.append(time.perf_counter() - began)
                processor.append(time.process_time() - spent)
    middle = float(np.median(wall))
    return {
        "terrain": terrain,
        "camera": camera,
        "pictures_per_s": significant(1 / middle),
        "wall_ms": significant(1e3 * middle),
        "processor_ms": significant(1e3 * float(np.median(processor))),
    }
