"""The literature's videos: walking flies with their legs in colours, and a worm that bends.

After Wang-Chen et al. 2024 (doi 10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import mujoco
import numpy as np
import pandas as pd

from flyrl.anatomy import LEGS
from flyrl.bodies.fly import FlyConfig
from flyrl.bodies.worm import DEMONSTRATION, WormConfig, build_worm
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.muscles import load_creature, movement
from flyrl.muscles.attachment import STEP, bend, last_neuron
from flyrl.report.captions import clock_text, jpeg, tension_bars, titled, with_legend
from flyrl.report.video import FLY_PACE, FPS, HOLD_FRAMES, encode, measured
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.marks import Overlay
from flyrl.simulation.rendering import Camera, FlyRenderer, Offscreen, Picture
from flyrl.simulation.worms import add_surroundings, side_view

WIDTH: Final = 640
HEIGHT: Final = 480

SETTLING_S: Final = 0.1
"""Simulated time before the film begins, s: the fly drops onto the ground and gets going."""

USUAL_BODY: Final = FlyConfig()
USUAL_OVERLAY: Final = Overlay()

_MEANINGS: Final = {
    "grips": "grips (tarsus)",
    "retracts": "retraction (tibia)",
    "stumbles": "stumbling (femur)",
}


@dataclass(frozen=True)
class Film:
    """A video on its own.

    Attributes
    ----------
    mp4
        The file: H.264, yuv420p.
    poster
        A picture of it, a JPEG file, to be shown until it plays.
    table
        The numbers that it shows.
    """

    mp4: bytes
    poster: bytes
    table: pd.DataFrame


def film_walk(
    title: str,
    *,
    controller: str = "hybrid",
    terrain: str = "flat",
    body: FlyConfig = USUAL_BODY,
    drive: tuple[float, float] = (1.0, 1.0),
    duration_s: float = 1.0,
    camera: Camera = "follow",
    distance: float | None = None,
    overlay: Overlay = USUAL_OVERLAY,
    coloured: Sequence[str] = ("grips",),
) -> Film:
    """Film a walk, a quarter as fast as life.

    Parameters
    ----------
    title
        Stands in the picture.
    controller, terrain
        Names of the leg controller and of the terrain.
    body
        The fly.
    drive
        To the left and to the right legs.
    duration_s
        Simulated time that is filmed, s.
    camera, distance, overlay
        See `FlyRenderer`.
    coloured
        Fields of `LegStates` whose colours the picture explains.

    Returns
    -------
    The video, whose poster is its last picture, and a table with a row per picture: `time_s`; the
    thorax's `x_mm`, `y_mm`, `z_mm` and `yaw_deg`, left positive and counted on beyond half a turn;
    `drive_left`, `drive_right`; of every leg, as 0 or 1, whether it `grips`, `retracts` and
    `stumbles`, and the ground's upward `force_uN` on it.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    OSError, RuntimeError
        If ffmpeg fails.
    """
    config = EnvConfig("hybrid_turning", body=body, terrain=terrain, controller=controller)
    env, scene = BatchedEnv(config, 1, 1), config.fly_scene
    speed, entries = FLY_PACE.frame_s * FPS, [(name, _MEANINGS[name]) for name in coloured]
    with closing(FlyRenderer(scene, WIDTH, HEIGHT, camera, overlay, distance)) as renderer:
        env.reset(seeds=[0])
        flies, timestep = env.flies, scene.physics.timestep
        flies.set_command(np.array([drive]))
        flies.step(round(SETTLING_S / timestep))
        pictures, rows = [], []
        for frame in range(round(duration_s / FLY_PACE.frame_s) + 1):
            if frame:
                flies.step(round(FLY_PACE.frame_s / timestep))
            time_s = frame * FLY_PACE.frame_s
            picture = measured(renderer.render(flies), renderer.pixels_per_mm, overlay)
            picture = titled(picture, title, clock_text(time_s, speed))
            pictures.append(with_legend(picture, entries) if entries else picture)
            rows.append({"time_s": time_s, **_row(flies, body)})
    mp4 = encode(pictures + pictures[-1:] * HOLD_FRAMES)
    table = pd.DataFrame(rows)
    table["yaw_deg"] = np.unwrap(table["yaw_deg"], period=360)
    return Film(mp4, jpeg(pictures[-1]), table)


_REFLEXES: Final = ("grips", "retracts", "stumbles")

WALKS: Final[Mapping[str, Callable[..., Film]]] = {
    "walk_cpg_without_adhesion": partial(
        film_walk,
        "CPG, without adhesion",
        controller="cpg",
        body=FlyConfig(adhesion_gain=0.0),
        overlay=Overlay(leg_colours=False, forces=True),
        coloured=(),
    ),
    "walk_cpg": partial(
        film_walk, "CPG, with adhesion", controller="cpg", overlay=Overlay(forces=True)
    ),
    "walk_rules": partial(film_walk, "rule-based", controller="rule_based"),
    "walk_hybrid": partial(
        film_walk,
        "hybrid: CPG and reflexes",
        terrain="mixed",
        duration_s=1.5,
        coloured=_REFLEXES,
    ),
    "turn_video": partial(
        film_walk,
        "drive (1.2, 0.2)",
        drive=(1.2, 0.2),
        duration_s=1.5,
        camera="top",
        distance=13.0,
        coloured=_REFLEXES,
    ),
}
"""Functions that film the walks of the literature, by the names of their videos."""


def _row(flies: FlyBatch, body: FlyConfig) -> dict[str, Any]:
    state = flies.state()
    x, y, z = state.position_w[0]
    forces = state.contact_forces_w[0].reshape(len(LEGS), -1, 3).sum(axis=1)
    row: dict[str, Any] = {"x_mm": x, "y_mm": y, "z_mm": z, "yaw_deg": np.degrees(state.yaw[0])}
    row["drive_left"], row["drive_right"] = state.command[0]
    legs = {name: on.astype(int) for name, on in flies.leg_states(0).items()}
    if not body.adhesion_gain:
        legs["grips"][:] = 0
    for name, of_legs in {**legs, "force_uN": forces[:, 2]}.items():
        row |= {f"{name}_{leg}": value for leg, value in zip(LEGS, of_legs, strict=True)}
    return row


HOLD_S: Final = 1.0
"""Time for which every number of neurons is held, s: the worm settles."""


def film_worm(config: WormConfig = DEMONSTRATION, step: int = STEP, hold_s: float = HOLD_S) -> Film:
    """Film a worm while more and more neurons of its muscle are recruited.

    Parameters
    ----------
    config
        The worm, with one muscle; by default the literature's.
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
    RenderingUnavailableError
        If no GL context can be made.
    OSError, RuntimeError
        If ffmpeg fails.
    """
    spec = build_worm(config)
    add_surroundings(spec)
    creature = load_creature(spec, config.profile_path.parent)
    model, data, last = creature.model, creature.data, last_neuron(creature)
    move, camera = movement(creature), side_view(config)
    pictures: list[Picture] = []
    rows = []
    with closing(Offscreen(model, WIDTH, HEIGHT)) as offscreen:
        for n in [*range(0, last, step), last]:
            tension = move(np.full(len(creature.muscles), n))
            for _ in range(round(hold_s * FPS)):
                mujoco.mj_step(model, data, round(1 / FPS / model.opt.timestep))
                # a step leaves the places of bodies as they were before it
                mujoco.mj_kinematics(model, data)
                mujoco.mj_camlight(model, data)
                bend_deg = np.degrees(bend(creature))
                picture = tension_bars(offscreen.draw(data, camera), tension)
                text = f"tension {tension[0]:.2f}   bend {bend_deg:.0f}°   real time"
                pictures.append(titled(picture, f"neurons up to {n}", text))
            rows.append((n, tension[0], bend_deg))
    table = pd.DataFrame(rows, columns=["n", "tension", "bend_deg"])
    mp4 = encode(pictures + pictures[-1:] * HOLD_FRAMES)
    return Film(mp4, jpeg(pictures[-1]), table)
