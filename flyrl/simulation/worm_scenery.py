"""How the literature's worm is shown: what surrounds it, from where, and the bar of its tension.

After cortex, Simulated Muscles, R. McIntyre (2012-14): the worm is suspended in mid air with its
lowest segment held in place, and a bar in the lower right corner fills with red in
proportion to tension.
"""

from typing import Final

import mujoco

from flyrl.bodies.worm import WormConfig

BAR_WIDTH: Final = 300
BAR_HEIGHT: Final = 20
"""px."""

BAR_RED: Final = (200, 24, 24)
BAR_EMPTY: Final = (236, 238, 241)
BAR_FRAME: Final = (40, 46, 54)


def add_surroundings(spec: mujoco.MjSpec) -> None:
    """Add a sky, and what holds a worm's first segment, to its specification, in place."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.62, 0.69, 0.76),
        rgb2=(0.88, 0.90, 0.92),
        width=64,
        height=64 * 6,
    )
    radius = spec.geom("Segment1").size[0]
    spec.worldbody.add_geom(
        name="holder",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(1.6 * radius, 1.6 * radius, 0.5 * radius),
        pos=(0, 0, -0.5 * radius),
        rgba=(0.35, 0.38, 0.42, 1),
        contype=0,
        conaffinity=0,
    )


def side_view(config: WormConfig) -> mujoco.MjvCamera:
    """Look along +y at the whole worm, which is suspended along +z and bends to +x."""
    length = config.segments * config.segment_length
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, -4.0, 1.7 * length
    camera.lookat[:] = (0.15 * length, 0.0, 0.45 * length)
    return camera
