"""The page: what is played, in MuJoCo's web viewer, with a panel.

The viewer runs in a thread of its own and knows a copy of the model. Messages go to and fro: keys
that are pressed, what the panel says, and the state that is drawn.
"""

import copy
import dataclasses
import logging
import socket
import time
from typing import Final

import mujoco
from mujoco.studio import (
    endpoints,
    launch_thread,
    messages,
    plugin,
    viewer_handle,
    viewer_protocol,
    web_viewer,
)
from mujoco.studio.dear_imgui import dear_imgui as imgui

from flyrl.play.loopback import Service, served_on
from flyrl.play.playable import Panel, Playable
from flyrl.play.session import Session
from flyrl.simulation.worm_scenery import BAR_EMPTY, BAR_FRAME, BAR_HEIGHT, BAR_RED, BAR_WIDTH

FRAME_S: Final = 1 / 60
"""Time from one state that is sent to the next."""

_IDLE_FRAME_S: Final = 0.1
"""The same while nobody watches."""

_START_S: Final = 10.0
"""How long the server may take to start."""

_MARGIN: Final = 16
"""px; from the panel to the corner."""


class PageUnavailableError(RuntimeError):
    """MuJoCo's web viewer does not start here."""


def show(session: Session, listening: socket.socket, *, opens_browser: bool = False) -> None:
    """Play in a page until interrupted.

    Parameters
    ----------
    session
        What is played.
    listening
        Where the page is served, see `flyrl.play.loopback.listen`; closed in the end.
    opens_browser
        Whether to open the page in a browser, where there is a screen.

    Raises
    ------
    PageUnavailableError
        If the viewer does not start.
    KeyboardInterrupt
        In the end.
    """
    _hush()
    playable = session.playable
    model = display_model(playable.model)
    data = mujoco.MjData(model)
    shown = None
    with (
        listening,
        served_on(listening) as service,
        _launch(session, model, service, opens_browser) as handle,
    ):
        # as if sent already: the viewer has it from the start
        handle.model, handle.data = model, data
        _await(handle, service)
        while handle.is_running():
            is_watched = service.connections > 0
            if is_watched != session.is_watched:
                session.watch(is_watched)
            session.advance(time.monotonic())
            data.qpos[:] = playable.data.qpos
            handle.sync(model, data)
            panel = playable.panel()
            if panel != shown:
                handle.send_to_viewer(_PanelSnapshot(panel))
                shown = panel
            time.sleep(FRAME_S if session.is_watched else _IDLE_FRAME_S)


def display_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Copy a model for being drawn: viewer and browser find the places of its bodies, no forces."""
    display = copy.deepcopy(model)
    bits = mujoco.mjtDisableBit
    display.opt.disableflags |= (
        bits.mjDSBL_CONSTRAINT | bits.mjDSBL_CONTACT | bits.mjDSBL_ACTUATION | bits.mjDSBL_SENSOR
    )
    return display


@dataclasses.dataclass(frozen=True)
class _PressEvent(messages.Event):
    key: str


@dataclasses.dataclass(frozen=True)
class _PanelSnapshot(messages.Snapshot):
    panel: Panel


class _Inbox(plugin.SimPlugin):
    """Hands on to the session what keys the viewer reads."""

    def __init__(self, session: Session) -> None:
        self._session = session

    @messages.handler
    def on_press(self, event: _PressEvent) -> None:
        self._session.press(event.key)


class _Desk(plugin.ViewerPlugin):
    """Draws the panel into the lower right corner, and reads the keys."""

    def __init__(self, playable: Playable) -> None:
        self._title = playable.title
        self._keys = [
            (letter, getattr(imgui.Key, letter.upper()), effect)
            for letter, effect in playable.keys.items()
        ]
        self._panel = playable.panel()

    @messages.handler
    def on_panel(self, snapshot: _PanelSnapshot) -> None:
        self._panel = snapshot.panel

    @messages.handler
    def on_gui(self, event: messages.BuildGuiEvent) -> None:
        self._read_keys()
        size = imgui.GetIO().DisplaySize
        corner = imgui.Vec2(size.x - _MARGIN, size.y - _MARGIN)
        imgui.SetNextWindowPos(corner, int(imgui.Cond.Always), imgui.Vec2(1, 1))
        flags = imgui.WindowFlags
        fixed = (flags.AlwaysAutoResize, flags.NoMove, flags.NoSavedSettings, flags.NoTitleBar)
        imgui.Begin(self._title, flags=sum(map(int, fixed)))
        imgui.TextUnformatted(self._panel.heading)
        imgui.TextUnformatted(self._panel.details)
        for share in self._panel.bars:
            _draw_bar(share)
        for letter, _, effect in self._keys:
            imgui.TextUnformatted(f"{letter}: {effect}")
        imgui.End()

    def _read_keys(self) -> None:
        for letter, key, _ in self._keys:
            # Not IsKeyDown: that stays true when a page closes with the key held.
            if imgui.IsKeyPressed(key, False):
                self.viewer.send_to_sim(_PressEvent(letter))


def _draw_bar(share: float) -> None:
    """Draw a bar, filled from the left with red, in a thin frame."""
    place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
    left, top = place.x + 2, place.y + 2
    bottom = top + BAR_HEIGHT
    parts = (
        (left - 2, top - 2, left + BAR_WIDTH + 2, bottom + 2, BAR_FRAME),
        (left, top, left + BAR_WIDTH, bottom, BAR_EMPTY),
        (left, top, left + round(BAR_WIDTH * share), bottom, BAR_RED),
    )
    for x0, y0, x1, y1, (red, green, blue) in parts:
        if x1 > x0:
            colour = imgui.GetColorU32(imgui.Vec4(red / 255, green / 255, blue / 255, 1.0))
            draw.AddRectFilled(imgui.Vec2(x0, y0), imgui.Vec2(x1, y1), colour)
    imgui.Dummy(imgui.Vec2(BAR_WIDTH + 4, BAR_HEIGHT + 4))


def _launch(
    session: Session, model: mujoco.MjModel, service: Service, opens_browser: bool
) -> viewer_handle.ViewerHandle:
    """Start the viewer in its thread."""
    config = viewer_protocol.ViewerConfig(title="flyrl play", gfx="web", open_browser=opens_browser)
    desk, camera = _Desk(session.playable), session.playable.camera

    def target(endpoint: endpoints.ViewerEndpoint) -> None:
        try:
            viewer = web_viewer.WebViewer(
                config, endpoint, model=model, camera=camera, plugins=[desk]
            )
        except Exception as error:
            raise PageUnavailableError(f"MuJoCo's web viewer does not start: {error}") from error
        if not service.is_confined:
            viewer.close()
            raise PageUnavailableError("this mujoco.studio cannot be kept to this computer")
        viewer_protocol.run_viewer_loop(viewer)

    return launch_thread.launch_thread(target, sim_plugins=[_Inbox(session)])


def _await(handle: viewer_handle.ViewerHandle, service: Service) -> None:
    """Wait until the page is served."""
    latest = time.monotonic() + _START_S
    while handle.is_running() and not service.is_running:
        if time.monotonic() > latest:
            raise PageUnavailableError("mujoco.studio does not serve its page")
        time.sleep(0.01)


def _hush() -> None:
    """Keep the viewer from telling stdout who comes and goes, and that anyone may."""
    logging.getLogger("WebServer").setLevel(logging.WARNING)
    web_viewer._print_url_banner = lambda host, port: None
