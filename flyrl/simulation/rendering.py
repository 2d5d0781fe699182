"""Pictures of a fly or a worm, without a screen."""

import importlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, ClassVar, Final, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import END_EFFECTORS
from flyrl.simulation.marks import PLAIN, LegColours, Mark, Overlay, Trace, add_marks, force_arrows
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.terrains import NOWHERE
from flyrl.validation import one_of

Camera = Literal["follow", "top", "goal"]
Picture = NDArray[np.uint8]

_CAMERAS: Final[dict[Camera, tuple[float, float, float]]] = {
    # azimuth and elevation in degrees, distance in mm
    "follow": (120.0, -22.0, 9.0),
    "top": (90.0, -89.0, 22.0),
    # azimuth from the goal's direction, distance with the fly at the goal
    "goal": (28.0, -28.0, 7.0),
}
_REACH: Final = 14.0
"""mm; how far a goal may be for the goal camera to keep it in the picture."""

_SMOOTHING: Final = 0.12
"""Share by which the camera's aim catches up per picture, so that it does not sway with the fly."""

_MAX_GEOMS: Final = 10_000


class RenderingUnavailableError(RuntimeError):
    """No GL library can draw here; everything but pictures works."""


class BodyRenderer:
    """Draws bodies of a scene with a camera that follows them; a subclass says how it does.

    Parameters
    ----------
    config
        The scene; it is compiled once more, with meshes, lights and props that are not solid.
    width, height
        Size of the picture, px.
    camera
        One of `cameras`.
    overlay
        What is drawn beside the body. Scale bar and clock are not: they are not of the scene, see
        `report.captions`.
    distance
        Of the camera from what it looks at, mm; None takes the camera's usual one.

    Attributes
    ----------
    cameras
        Where it can look from, the usual one first.
    pixels_per_mm
        How many pixels 1 mm across the line of sight took in the last picture, where the body is.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    ValueError
        If there is no such camera.
    """

    cameras: ClassVar[tuple[Camera, ...]]

    def __init__(
        self,
        config: SceneConfig,
        width: int = 640,
        height: int = 480,
        camera: Camera = "follow",
        overlay: Overlay = PLAIN,
        distance: float | None = None,
    ) -> None:
        self._config = config
        self._view = one_of("camera", camera, self.cameras)
        self._overlay = overlay
        self._model = build_scene(config, visual=True).model
        self._data = mujoco.MjData(self._model)
        self._markers = [
            i for i, prop in enumerate(config.props) if prop.at_goal or prop.shape == "marker"
        ]
        self._camera = mujoco.MjvCamera()
        self._offscreen = Offscreen(self._model, width, height)
        self.pixels_per_mm = 0.0
        self._set_up()
        if distance is not None:
            self._camera.distance = distance

    def render(self, batch: Any, sim: int = 0, goal: tuple[float, ...] = ()) -> Picture:
        """Draw simulation `sim`, (height, width, 3); the camera "goal" looks at x, y, mm."""
        batch.copy_into(sim, self._model, self._data)
        if not self._overlay.target:
            self._data.mocap_pos[self._markers] = NOWHERE
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        middle = self._look(goal)
        picture = self._offscreen.draw(self._data, self._camera, self._marks(batch, sim))
        self.pixels_per_mm = self._offscreen.pixels_per_mm(middle)
        return picture

    def close(self) -> None:
        """Free the GL context."""
        self._offscreen.close()

    def _set_up(self) -> None:
        """Make ready what is special to the body, and aim the camera."""

    def _look(self, goal: tuple[float, ...]) -> NDArray[np.float64]:
        """Point the camera at the body that is posed now; return where it is, mm, (3,)."""
        raise NotImplementedError

    def _marks(self, batch: Any, sim: int) -> list[Mark]:
        """What is drawn into the scene."""
        return []


class FlyRenderer(BodyRenderer):
    """Draws flies of a scene with a camera that follows the thorax.

    The camera "follow" looks from ahead and above, "top" straight down, "goal" from the start
    towards the goal, with both the fly and a goal that is not far in the picture. Parameters and
    errors are those of `BodyRenderer`.
    """

    cameras = get_args(Camera)

    def _set_up(self) -> None:
        self._leg_colours = LegColours(self._model) if self._overlay.leg_colours else None
        self._traces: dict[int, Trace] = {}
        self._feet = [self._model.body(name).id for name in END_EFFECTORS]
        camera = self._camera
        camera.azimuth, camera.elevation, camera.distance = _CAMERAS[self._view]
        self._aim: tuple[tuple[float, ...], NDArray[np.float64], float] | None = None

    def _look(self, goal: tuple[float, ...]) -> NDArray[np.float64]:
        thorax: NDArray[np.float64] = self._data.body("Thorax").xpos
        if self._view == "goal" and goal:
            self._aim_at(thorax, goal)
        else:
            self._camera.lookat[:] = thorax
        return thorax

    def _marks(self, batch: Any, sim: int) -> list[Mark]:
        """Add a piece of the trace and the forces; the legs take their colours."""
        if self._leg_colours is not None:
            self._leg_colours.apply(batch.leg_states(sim))
        marks: list[Mark] = []
        if self._overlay.trace:
            trace = self._traces.setdefault(sim, Trace(self._config.terrain))
            trace.add(self._data.time, self._data.body("Thorax").xpos, batch.ground(sim))
            marks += trace.marks()
        if self._overlay.forces:
            forces_w = batch.senses["contact_forces_w"][sim]
            marks += force_arrows(forces_w, self._data.xpos[self._feet])
        return marks

    def _aim_at(self, thorax: NDArray[np.float64], goal: tuple[float, ...]) -> None:
        """Look past the fly towards the goal; a new goal is a new shot."""
        offset = np.array([*goal, thorax[2]]) - thorax
        distance = float(np.linalg.norm(offset))
        if distance > _REACH:
            offset *= _REACH / distance
        angle, _, near = _CAMERAS["goal"]
        zoom = near + 0.8 * min(distance, _REACH)
        lookat = thorax + 0.4 * offset
        if self._aim is None or self._aim[0] != goal:
            azimuth = np.degrees(np.arctan2(offset[1], offset[0]))
            self._camera.azimuth = azimuth + angle
        else:
            _, last, last_zoom = self._aim
            lookat = last + _SMOOTHING * (lookat - last)
            zoom = last_zoom + _SMOOTHING * (zoom - last_zoom)
        self._aim = (goal, lookat, zoom)
        self._camera.lookat[:] = lookat
        self._camera.distance = zoom


class Offscreen:
    """A picture in memory, and the GL context that draws it.

    Parameters
    ----------
    model
        What is drawn; quality and size of its pictures are set.
    width, height
        Size of the picture, px.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        # software GL draws 5-9 times as fast without multisampling and with small shadow maps
        model.vis.quality.offsamples, model.vis.quality.shadowsize = 0, 1024
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        try:
            self._gl = _gl_context(width, height)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        except Exception as error:  # whatever a missing GL library raises
            raise RenderingUnavailableError(
                f"no GL library can draw here ({error}); install Mesa's EGL (Debian: libegl1 "
                "libgl1-mesa-dri) or set MUJOCO_GL to one of egl, osmesa, glfw"
            ) from error
        self._model = model
        self._scene = mujoco.MjvScene(model, maxgeom=_MAX_GEOMS)
        self._option = mujoco.MjvOption()
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._shape = (height, width, 3)

    def draw(
        self, data: mujoco.MjData, camera: mujoco.MjvCamera, marks: Sequence[Mark] = ()
    ) -> Picture:
        """Draw what `camera` sees of `data`, and marks, (height, width, 3), first row on top."""
        self._gl.make_current()
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, camera, everything, self._scene
        )
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.type in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD):
                # decoration casts no shadow: the ground's own is speckles
                geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        add_marks(marks, self._scene)
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        picture = np.empty(self._shape, dtype=np.uint8)
        mujoco.mjr_readPixels(picture, None, self._viewport, self._context)
        return picture[::-1]

    def pixels_per_mm(self, point_w: NDArray[np.float64]) -> float:
        """Pixels that 1 mm across the line of sight took in the last picture, at a point, mm."""
        camera = self._scene.camera[0]
        depth = camera.forward @ (point_w - camera.pos)
        side = depth * (camera.frustum_top - camera.frustum_bottom) / camera.frustum_near
        return self._shape[0] / float(side)

    def close(self) -> None:
        """Free what GL holds."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()


def _gl_context(width: int, height: int) -> Any:
    """Make a GL context that MuJoCo can draw in.

    MuJoCo settles on a GL library when it is imported: the one that MUJOCO_GL names, else GLFW,
    which needs a screen. Where there is none, EGL is taken instead.
    """
    if not hasattr(mujoco, "GLContext"):
        raise RuntimeError("MUJOCO_GL switches pictures off")
    with suppress(ImportError):
        # PyTorch's optimisers load it, where it is, and each brings an LLVM, as Mesa does: loaded
        # after Mesa's, Triton's crashes the process
        importlib.import_module("triton")
    if _is_without_screen():
        from mujoco.egl import GLContext  # noqa: PLC0415 - loads libEGL, which may be missing

        return GLContext(width, height)
    return mujoco.GLContext(width, height)


def _is_without_screen() -> bool:
    screen = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")
    return sys.platform == "linux" and not any(os.environ.get(name) for name in screen)


def can_draw_in_threads() -> bool:
    """Whether several renderers can draw at once; GLFW's windows belong to the main thread."""
    settled_on = getattr(mujoco, "GLContext", None)
    name = getattr(settled_on, "__module__", "")
    return _is_without_screen() or name in ("mujoco.egl", "mujoco.osmesa")


_WORM_CAMERAS: Final = {
    # azimuth and elevation in degrees, distance in lengths of the worm
    "crawling": (120.0, -38.0, 1.7),
    # from the worm's side, so that it bends in the plane of the picture
    "hanging": (90.0, -6.0, 2.1),
    "top": (90.0, -89.0, 2.6),
}

_ASIDE: Final = (0.191, -0.051, 0.0)
"""Lengths of the worm, world frame, by which the follow camera aims past a crawling worm: to the
right of it and below it in the picture, where the tensions are drawn."""

_SQUARE: Final = 5.0
"""Side of the ground's squares, mm: those of a fly's ground would shimmer at this distance."""


class WormRenderer(BodyRenderer):
    """Draws worms of a scene with a camera that follows the middle of a crawling worm.

    The camera "follow" looks at a crawling worm from ahead and above, at a hanging one from its
    side; "top" straight down. Parameters and errors are those of `BodyRenderer`.
    """

    cameras = ("follow", "top")

    def _set_up(self) -> None:
        self._model.mat("ground_grid").texrepeat = (1 / _SQUARE, 1 / _SQUARE)
        body = self._config.body
        self._segments = [self._model.geom(f"Segment{i + 1}").id for i in range(body.segments)]
        length = body.segments * body.segment_length
        self._crawls, is_top = body.mount == "crawling", self._view == "top"
        camera = self._camera
        azimuth, elevation, lengths = _WORM_CAMERAS["top" if is_top else body.mount]
        camera.azimuth, camera.elevation, camera.distance = azimuth, elevation, lengths * length
        self._aside = np.zeros(3) if is_top else length * np.array(_ASIDE)

    def _look(self, goal: tuple[float, ...]) -> NDArray[np.float64]:
        middle: NDArray[np.float64] = self._data.geom_xpos[self._segments].mean(axis=0)
        if self._crawls:
            self._camera.lookat[:] = middle + self._aside
        else:
            # it stays where the worm hangs
            self._camera.lookat[:] = (0.0, 0.0, self._model.body("Segment1").pos[2] / 2)
        return middle
