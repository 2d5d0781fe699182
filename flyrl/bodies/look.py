"""Look of the fly: colours, light."""

from typing import Final

import mujoco
import numpy as np

_VIEW_CENTRE: Final = (-0.5, 0.0, -0.4)
"""Middle of the fly in the thorax frame, mm."""


VISUAL_GROUP: Final = 1
"""Of geoms that are drawn."""

Colour = tuple[float, float, float, float]


COLOURS: Final[dict[str, Colour]] = {
    "Thorax": (0.50, 0.33, 0.17, 1.0),
    "Head": (0.56, 0.38, 0.20, 1.0),
    "Eye": (0.48, 0.07, 0.06, 1.0),
    "Wing": (0.74, 0.80, 0.88, 0.28),
    "Haltere": (0.82, 0.70, 0.46, 1.0),
    "Pedicel": (0.66, 0.47, 0.26, 1.0),
    "Funiculus": (0.72, 0.52, 0.29, 1.0),
    "Arista": (0.22, 0.16, 0.12, 1.0),
    "Rostrum": (0.70, 0.52, 0.31, 1.0),
    "Haustellum": (0.74, 0.57, 0.36, 1.0),
    "A1A2": (0.78, 0.60, 0.34, 1.0),
    "A3": (0.72, 0.53, 0.28, 1.0),
    "A4": (0.62, 0.44, 0.22, 1.0),
    "A5": (0.46, 0.31, 0.15, 1.0),
    "A6": (0.27, 0.18, 0.10, 1.0),
    "Coxa": (0.76, 0.57, 0.27, 1.0),
    "Femur": (0.80, 0.62, 0.31, 1.0),
    "Tibia": (0.84, 0.67, 0.36, 1.0),
    "Tarsus": (0.71, 0.53, 0.29, 1.0),
}
"""Colour by the part of a body's name that it contains; the longest match wins."""


def add_light(spec: mujoco.MjSpec, root: str) -> None:
    """A sun that moves with the fly, since MuJoCo draws shadows only near its aim.

    It stands overhead: under a slanting one the ground shadows itself in speckles, where the drawn
    shadows end.
    """
    direction = np.array((0.0, 0.0, -1.0))
    spec.body(root).add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        pos=np.array(_VIEW_CENTRE) - 10 * direction,
        dir=direction,
        diffuse=(0.6, 0.58, 0.54),
        specular=(0.2, 0.2, 0.2),
        castshadow=True,
    )


def set_look(spec: mujoco.MjSpec) -> None:
    """Viewing figures for a scene of a few mm; software rendering without multisampling."""
    spec.visual.quality.offsamples = 0
    spec.visual.quality.shadowsize = 1024
    spec.visual.global_.offwidth = 1280
    spec.visual.global_.offheight = 720
    spec.stat.extent = 5.0
    spec.visual.map.znear = 0.01
    spec.visual.map.zfar = 60.0
    spec.visual.map.shadowclip = 2.0
    spec.visual.headlight.ambient = (0.3, 0.3, 0.3)
    spec.visual.headlight.diffuse = (0.25, 0.25, 0.25)
    spec.visual.headlight.specular = (0.05, 0.05, 0.05)
