"""The page: what is played, in MuJoCo's web viewer, with a panel.

The viewer runs in a thread of its own and knows a copy of the model. Messages go to and fro: what a
person does, what the panel says, and the state that is drawn.
"""

import copy
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

from flyrl.play.desk import (
    AimEvent,
    CameraSnapshot,
    ChangeEvent,
    Desk,
    LeaveEvent,
    PanelSnapshot,
    PointEvent,
    PressEvent,
)
from flyrl.play.display import copy_state, display_model
from flyrl.play.loopback import Service, served_on
from flyrl.play.session import Session

FRAME_S: Final = 1 / 60
"""Time from one state that is sent to the next."""

_PAUSED_FRAME_S: Final = 1 / 25
"""The same while time stands still."""

_IDLE_FRAME_S: Final = 0.2
"""The same while nobody watches."""

_PANEL_S: Final = 1 / 25
"""Time from one panel to the next."""

_START_S: Final = 10.0
"""How long the server may take to start."""


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
    inbox = _Inbox(session)
    drawn, model = playable.model, display_model(playable.model)
    data = mujoco.MjData(model)
    shown, next_panel_s = None, 0.0
    with (
        listening,
        served_on(listening) as service,
        _launch(session, inbox, model, service, opens_browser) as handle,
    ):
        # as if sent already: the viewer has it from the start
        handle.model, handle.data = model, data
        _await(handle, service)
        while handle.is_running():
            began_s = time.monotonic()
            is_watched = service.connections > 0
            if is_watched != session.is_watched:
                session.watch(is_watched)
                if not is_watched:
                    handle.send_to_viewer(LeaveEvent())
            session.advance(began_s)
            if playable.model is not drawn:
                drawn, model = playable.model, display_model(playable.model)
                data = mujoco.MjData(model)
                handle.send_to_viewer(AimEvent(copy.copy(playable.camera)))
            copy_state(playable.data, data)
            handle.sync(model, data)
            if began_s >= next_panel_s:
                next_panel_s = began_s + _PANEL_S
                panel = PanelSnapshot(session.sections(), playable.hint, inbox.latest_change)
                if panel != shown:
                    handle.send_to_viewer(panel)
                    shown = panel
            time.sleep(max(0.001, _frame_s(session) - (time.monotonic() - began_s)))


def _frame_s(session: Session) -> float:
    """Time from one state to the next."""
    if not session.is_watched:
        return _IDLE_FRAME_S
    return _PAUSED_FRAME_S if session.is_paused else FRAME_S


class _Inbox(plugin.SimPlugin):
    """Hands on to the session what a person does."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.latest_change = 0

    @messages.handler
    def on_press(self, event: PressEvent) -> None:
        self._session.press(event.key)

    @messages.handler
    def on_change(self, event: ChangeEvent) -> None:
        self._session.change(event.name, event.value)
        self.latest_change = event.number

    @messages.handler
    def on_point(self, event: PointEvent) -> None:
        self._session.point(event.x_w, event.y_w)

    @messages.handler
    def on_camera(self, snapshot: CameraSnapshot) -> None:
        self._session.camera = snapshot.camera


class _Viewer(web_viewer.WebViewer):
    """The viewer, which rests while no browser shows it: by itself it would ask all the time."""

    service: Service

    def prepare_next_frame(self) -> bool:
        if not self.service.connections:
            time.sleep(_IDLE_FRAME_S / 2)
            return False
        return bool(super().prepare_next_frame())


def _launch(
    session: Session,
    inbox: _Inbox,
    model: mujoco.MjModel,
    service: Service,
    opens_browser: bool,
) -> viewer_handle.ViewerHandle:
    """Start the viewer in its thread."""
    config = viewer_protocol.ViewerConfig(title="flyrl play", gfx="web", open_browser=opens_browser)
    desk = Desk(session.playable.title, session.keys)
    camera = copy.copy(session.camera)

    def target(endpoint: endpoints.ViewerEndpoint) -> None:
        try:
            viewer = _Viewer(config, endpoint, model=model, camera=camera, plugins=[desk])
        except Exception as error:
            raise PageUnavailableError(f"MuJoCo's web viewer does not start: {error}") from error
        if not service.is_confined:
            viewer.close()
            raise PageUnavailableError("this mujoco.studio cannot be kept to this computer")
        viewer.service = service
        viewer_protocol.run_viewer_loop(viewer)

    return launch_thread.launch_thread(target, sim_plugins=[inbox])


def _await(handle: viewer_handle.ViewerHandle, service: Service) -> None:
    """Wait until the page is served."""
    latest = time.monotonic() + _START_S
    while handle.is_running() and not service.is_running:
        if time.monotonic() > latest:
            raise PageUnavailableError("mujoco.studio does not serve its page")
        time.sleep(0.01)


def _hush() -> None:
    """Keep the viewer from telling stdout who comes and goes, that anyone may, and new models."""
    logging.getLogger("WebServer").setLevel(logging.WARNING)
    vars(web_viewer)["print"] = lambda *words, **settings: None
    web_viewer._print_url_banner = lambda host, port: None
