"""Pictures of a worm, without a screen."""

from typing import Final, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.simulation.rendering import Offscreen
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.simulation.worms import WormBatch
from flyrl.validation import one_of

Camera = Literal["follow", "top"]

_CRAWLING: Final[dict[Camera, tuple[float, float, float]]] = {
    # azimuth and elevation in degrees, distance in lengths of the worm
    "follow": (120.0, -38.0, 1.7),
    "top": (90.0, -89.0, 2.6),
}
_HANGING: Final[dict[Camera, tuple[float, float, float]]] = {
    # from the worm's side, so that it bends in the plane of the picture
    "follow": (90.0, -6.0, 2.1),
    "top": (90.0, -89.0, 2.6),
}

_ASIDE: Final = 0.14
"""Lengths of the worm by which the follow camera aims past a crawling worm, to the right and below
it, where the tensions are drawn."""

_SQUARE: Final = 5.0
"""Side of the ground's squares, mm: those of a fly's ground would shimmer at this distance."""


class WormRenderer:
    """Draws worms of a scene with a camera that follows the middle of a crawling worm.

    Parameters
    ----------
    config
        The scene; it is compiled once more, with a target marker.
    width, height
        Size of the picture, px.
    camera
        "follow" looks at a crawling worm from ahead and above, at a hanging one from its side;
        "top" straight down.

    Attributes
    ----------
    pixels_per_mm
        How many pixels 1 mm across the line of sight took in the last picture, at the middle of the
        worm.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    ValueError
        If there is no such camera.
    """

    def __init__(
        self,
        config: SceneConfig,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
    ) -> None:
        one_of("camera", camera, get_args(Camera))
        self._model = build_scene(config, visual=True).model
        self._model.mat("ground_grid").texrepeat = (1 / _SQUARE, 1 / _SQUARE)
        # software GL draws 5-9 times as fast without multisampling
        self._model.vis.quality.offsamples = 0
        self._model.vis.global_.offwidth = width
        self._model.vis.global_.offheight = height
        self._data = mujoco.MjData(self._model)
        self._offscreen = Offscreen(self._model, width, height)
        self.pixels_per_mm = 0.0
        body = config.body
        length = body.segments * body.segment_length
        self._crawls = body.mount == "crawling"
        azimuth, elevation, lengths = (_CRAWLING if self._crawls else _HANGING)[camera]
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = azimuth, elevation
        self._camera.distance = lengths * length
        angle = np.radians(azimuth)
        right, near = (np.sin(angle), -np.cos(angle)), (-np.cos(angle), -np.sin(angle))
        aside = _ASIDE * length if camera == "follow" and self._crawls else 0.0
        self._aim = aside * np.array([right[0] + near[0], right[1] + near[1], 0.0])

    def render(
        self, worms: WormBatch, sim: int = 0, goal: tuple[float, ...] = ()
    ) -> NDArray[np.uint8]:
        """Draw simulation `sim`, as (height, width, 3); a worm has no goal."""
        worms.copy_into(sim, self._model, self._data)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        middles = self._data.geom_xpos[worms.segment_geoms]
        if self._crawls:
            self._camera.lookat[:] = middles.mean(axis=0) + self._aim
        else:
            # it stays where the worm hangs
            self._camera.lookat[:] = (0.0, 0.0, self._model.body("Segment1").pos[2] / 2)
        self.pixels_per_mm = self._offscreen.pixels_per_mm(self._camera, middles.mean(axis=0))
        return self._offscreen.draw(self._data, self._camera)

    def close(self) -> None:
        """Free the GL context."""
        self._offscreen.close()
