"""Pictures of a fly, without a screen."""

import os
import sys
from typing import Final, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.simulation.batch import FlyBatch
from flyrl.simulation.scene import TARGET_MARKER, SceneConfig, build_scene
from flyrl.terrains import base_height

Camera = Literal["follow", "top"]

_CAMERAS: Final[dict[Camera, tuple[float, float, float]]] = {
    # azimuth and elevation in degrees, distance in mm
    "follow": (120.0, -22.0, 9.0),
    "top": (90.0, -89.0, 22.0),
}


class RenderingUnavailableError(RuntimeError):
    """No GL library can draw here; everything but pictures works."""


class FlyRenderer:
    """Draws flies of a scene with a camera that follows the thorax.

    Parameters
    ----------
    config
        The scene; it is compiled once more, with meshes, lights and a target marker.
    width, height
        Size of the picture, px.
    camera
        "follow" looks from behind and above, "top" straight down.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """

    def __init__(
        self,
        config: SceneConfig,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
    ) -> None:
        if camera not in _CAMERAS:
            raise ValueError(f"camera is {camera!r}; it must be one of {tuple(_CAMERAS)}")
        self._model = build_scene(config, visual=True).model
        # software GL draws 5-9 times as fast without multisampling and with small shadow maps
        self._model.vis.quality.offsamples = 0
        self._model.vis.quality.shadowsize = 1024
        self._model.vis.global_.offwidth = max(width, self._model.vis.global_.offwidth)
        self._model.vis.global_.offheight = max(height, self._model.vis.global_.offheight)
        self._data = mujoco.MjData(self._model)
        self._ground = base_height(config.terrain)
        try:
            _prefer_egl_without_screen()
            self._renderer = mujoco.Renderer(self._model, height, width)
        except Exception as error:  # whatever a missing GL library raises
            raise RenderingUnavailableError(
                f"no GL library can draw here ({error}); install Mesa's EGL (Debian: libegl1 "
                "libgl1-mesa-dri) or set MUJOCO_GL to one of egl, osmesa, glfw"
            ) from error
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation, self._camera.distance = _CAMERAS[camera]

    def render(
        self, flies: FlyBatch, sim: int = 0, goal: tuple[float, ...] = ()
    ) -> NDArray[np.uint8]:
        """Draw simulation `sim`, and the target at `goal` (x, y in mm), as (height, width, 3)."""
        flies.copy_into(sim, self._model, self._data)
        if goal:
            marker = self._model.body(TARGET_MARKER).mocapid[0]
            self._data.mocap_pos[marker] = (*goal, self._ground + 0.02)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._camera.lookat[:] = self._data.body("Thorax").xpos
        self._renderer.update_scene(self._data, self._camera)
        return np.asarray(self._renderer.render())

    def close(self) -> None:
        """Free the GL context."""
        self._renderer.close()


def _prefer_egl_without_screen() -> None:
    """Let MuJoCo draw with EGL where there is no screen and nobody chose otherwise.

    MuJoCo picks its GL library when it is imported, from MUJOCO_GL; by now that is too late to set.
    """
    if sys.platform == "linux" and not (os.environ.get("MUJOCO_GL") or os.environ.get("DISPLAY")):
        from mujoco import egl  # noqa: PLC0415
        from mujoco.rendering.classic import gl_context  # noqa: PLC0415

        gl_context.GLContext = egl.GLContext
