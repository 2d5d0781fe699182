"""The page: what is played, in MuJoCo's web viewer, with a panel, on this computer alone.

A single loop steps the simulation, reads keys and mouse, and draws. The viewer knows a copy of the
model without forces. The page is served from the start, and waits for the model.
"""

import contextlib
import copy
import functools
import io
import logging
import socket
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from mujoco.studio import launch_thread, messages, ux, viewer_protocol, web_viewer
from mujoco.studio.dear_imgui import dear_imgui as imgui

from flyrl.play.panel import Panel, Setting
from flyrl.play.server import Service, served_on

if TYPE_CHECKING:  # the page is served before that is imported, which takes seconds
    from flyrl.play.session import Session

_CLICK: Final = "click"
"""Among the keys: a click on the ground."""

STATE: Final = mujoco.mjtState.mjSTATE_INTEGRATION
"""State of what is played that is sent to the page."""

_PAUSED_FRAME_S: Final = 1 / 25
"""Time from one state that is sent to the next while time stands still; else the viewer's own."""

_IDLE_FRAME_S: Final = 0.2
"""Time from one look for a page to the next while nobody watches."""

_MARGIN: Final = 12
"""px; from the panel to the page's edges."""

_WIDTH: Final = 330
"""px; of the panel."""


@contextlib.contextmanager
def serve(listening: socket.socket) -> Iterator[Callable[["Session"], None]]:
    """Serve a page, which waits for something to play.

    Parameters
    ----------
    listening
        Where, see `listen`.

    Yields
    ------
    Function that plays a session there until interrupted, or until the viewer is closed.

    Raises
    ------
    OSError
        If the viewer does not start.
    """
    logging.getLogger("WebServer").setLevel(logging.WARNING)  # it logs every connection
    config = viewer_protocol.ViewerConfig(title="flyrl play", gfx="web")
    endpoint, _ = launch_thread.make_thread_endpoints()
    with served_on(listening) as service:
        try:
            with _silence():
                viewer = web_viewer.WebViewer(config, endpoint)
        except Exception as error:
            raise OSError(f"MuJoCo's web viewer does not start: {error}") from error
        with contextlib.closing(viewer):
            # a new page asks for it, and is not always heard: the panel would look now so, now so
            ux.setup_theme(ux.GuiTheme.DARK)
            if not service.is_guarded.wait(timeout=10.0):  # s
                raise OSError("this mujoco.studio cannot be kept to this computer")
            yield functools.partial(_play, viewer, service)


def _play(viewer: web_viewer.WebViewer, service: Service, session: "Session") -> None:
    """Play a session until interrupted, or until the viewer is closed."""
    playable = session.playable
    viewer.camera = session.camera
    drawn: mujoco.MjModel | None = None
    forgets_keys = False
    while viewer.is_running():
        began_s = time.monotonic()
        is_watched = service.connections > 0
        if is_watched != session.is_watched:
            session.watch(is_watched)
            forgets_keys |= not is_watched
        session.advance(began_s)
        if playable.model is not drawn:
            drawn = playable.model
            for name in ("type", "trackbodyid", "fixedcamid"):
                setattr(viewer.camera, name, getattr(playable.camera, name))
            with _silence():
                viewer.dispatch(messages.ModelEvent(model=display_model(drawn)))
            service.is_ready = True
        mujoco.mj_copyState(playable.model, playable.data, viewer.data, STATE)
        # by itself it would ask for a browser all the time
        if is_watched and viewer.prepare_next_frame():
            viewer.dispatch(messages.UpdateEvent())
            _draw(viewer, session, forgets_keys)
            forgets_keys = False
            viewer.sync()
        frame_s = _PAUSED_FRAME_S if session.is_paused else 0.001
        least_s = frame_s if is_watched else _IDLE_FRAME_S
        time.sleep(max(0.001, least_s - (time.monotonic() - began_s)))


def _draw(viewer: web_viewer.WebViewer, session: "Session", forgets_keys: bool) -> None:
    """Draw a picture of the panel; do what a person does."""
    io = imgui.GetIO()
    # keys are the simulation's, not for going from control to control
    io.ConfigFlags &= ~int(imgui.ConfigFlags.NavEnableKeyboard)
    deaf = int(imgui.ConfigFlags.NoKeyboard)
    if forgets_keys:
        # a page that closed never reports that keys were released. For the next picture, at
        # whose begin Dear ImGui then clears its keys; not before the new page is there, since a
        # connection sets flags itself
        io.ConfigFlags |= deaf
    elif io.ConfigFlags & deaf:
        io.ConfigFlags &= ~deaf
    elif not io.WantCaptureKeyboard:
        for name in session.keys:
            if name != _CLICK and imgui.IsKeyPressed(_key(name), False):
                session.change(name, True)
    if (
        _CLICK in session.keys
        and io.KeyShift
        and not io.WantCaptureMouse
        and imgui.IsMouseClicked(imgui.MouseButton.Left)
    ):
        mouse, size = io.MousePos, io.DisplaySize
        place = mouse.x / size.x, mouse.y / size.y
        point = ground_point(viewer.model, viewer.data, viewer.camera, *place, size.x / size.y)
        if point is not None:
            session.change(_CLICK, point)
    for name, value in _draw_panel(session).items():
        session.change(name, value)


def _draw_panel(session: "Session") -> dict[str, Setting]:
    """Draw the panel at the left of the page; return what a person has changed.

    At the left, since the width of the page is only known some pictures after it was opened.
    """
    panel = Panel()
    height = imgui.GetIO().DisplaySize.y - 2 * _MARGIN
    imgui.SetNextWindowPos(imgui.Vec2(_MARGIN, _MARGIN), int(imgui.Cond.Always))
    # as high as its content, if that fits
    imgui.SetNextWindowSizeConstraints(imgui.Vec2(_WIDTH, 0.0), imgui.Vec2(_WIDTH, height))
    flags = imgui.WindowFlags
    fixed = (flags.AlwaysAutoResize, flags.NoMove, flags.NoSavedSettings, flags.NoDocking)
    is_unfolded, is_open = imgui.Begin(session.playable.title, True, sum(map(int, fixed)))
    if not is_open:  # closed it would not come back
        imgui.SetWindowCollapsed(True)
    if is_unfolded:
        panel.text(session.playable.hint)
        session.draw(panel)
        if panel.section("Keys and mouse"):
            for name, text in session.keys.items():
                panel.text(f"{'shift + click' if name == _CLICK else name}: {text}")
            panel.text("drag: turn the view;  wheel: nearer, farther")
    imgui.End()
    return panel.changes


def _key(name: str) -> imgui.Key:
    title = name.title()
    return getattr(imgui.Key, title if hasattr(imgui.Key, title) else f"{title}Arrow")


def _silence() -> contextlib.AbstractContextManager[io.StringIO]:
    """Keep the viewer from telling stdout its address, that anyone may come, and new models."""
    return contextlib.redirect_stdout(io.StringIO())


def display_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Copy a model for viewer and browser, which run MuJoCo on it to find where bodies are.

    It has no contacts, constraints, actuators or sensors.
    """
    display = copy.deepcopy(model)
    bits = mujoco.mjtDisableBit
    display.opt.disableflags |= (
        bits.mjDSBL_CONSTRAINT | bits.mjDSBL_CONTACT | bits.mjDSBL_ACTUATION | bits.mjDSBL_SENSOR
    )
    return display


def ground_point(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    camera: mujoco.MjvCamera,
    x: float,
    y: float,
    aspect: float,
) -> tuple[float, float] | None:
    """Point of the ground that is seen at a place of the picture, x and y in mm.

    None where nothing is seen there, or something that stands on the ground.

    Parameters
    ----------
    model, data
        What is drawn.
    camera
        From where it is seen.
    x, y
        Place as shares of the picture's width and height, from its upper left corner.
    aspect
        Width of the picture, divided by its height.
    """
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene(model, maxgeom=1)
    mujoco.mjv_updateCamera(model, data, camera, scene)
    point_w, ids = np.zeros(3), np.zeros((3, 1, 1), np.int32)  # of geom, flex and skin
    body = mujoco.mjv_select(
        model, data, mujoco.MjvOption(), aspect, x, 1 - y, scene, point_w, *ids
    )
    # the world is body 0
    return (float(point_w[0]), float(point_w[1])) if body == 0 else None
