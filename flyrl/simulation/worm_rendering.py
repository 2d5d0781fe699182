"""Pictures of a worm, without a screen."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.simulation.overlay import PLAIN, Overlay
from flyrl.simulation.rendering import BodyRenderer, Camera
from flyrl.simulation.scene import SceneConfig

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


class WormRenderer(BodyRenderer):
    """Draws worms of a scene with a camera that follows the middle of a crawling worm.

    The camera "follow" looks at a crawling worm from ahead and above, at a hanging one from its
    side; "top" straight down. Parameters and errors are those of `BodyRenderer`.
    """

    cameras = ("follow", "top")

    def __init__(
        self,
        config: SceneConfig,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
        overlay: Overlay = PLAIN,
    ) -> None:
        super().__init__(config, width, height, camera, overlay)
        self._model.mat("ground_grid").texrepeat = (1 / _SQUARE, 1 / _SQUARE)
        body = config.body
        self._segments = [self._model.geom(f"Segment{i + 1}").id for i in range(body.segments)]
        length = body.segments * body.segment_length
        self._crawls = body.mount == "crawling"
        azimuth, elevation, lengths = (_CRAWLING if self._crawls else _HANGING)[camera]
        self._camera.azimuth, self._camera.elevation = azimuth, elevation
        self._camera.distance = lengths * length
        angle = np.radians(azimuth)
        right, near = (np.sin(angle), -np.cos(angle)), (-np.cos(angle), -np.sin(angle))
        aside = _ASIDE * length if camera == "follow" and self._crawls else 0.0
        self._aim = aside * np.array([right[0] + near[0], right[1] + near[1], 0.0])

    def _look(self, goal: tuple[float, ...]) -> NDArray[np.float64]:
        middle: NDArray[np.float64] = self._data.geom_xpos[self._segments].mean(axis=0)
        if self._crawls:
            self._camera.lookat[:] = middle + self._aim
        else:
            # it stays where the worm hangs
            self._camera.lookat[:] = (0.0, 0.0, self._model.body("Segment1").pos[2] / 2)
        return middle
