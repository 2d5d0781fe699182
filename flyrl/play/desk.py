"""The person's side of the page, in the viewer's thread: the panel, the keys, clicks on the ground.

It knows nothing of the simulation. Messages go to and fro: what a person does, and what the panel
shows.
"""

import copy
import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Final

import mujoco
from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as imgui

from flyrl.play.panel import Line, Section, Setting
from flyrl.play.pointing import camera_view, ground_point
from flyrl.play.widgets import draw_section

_MARGIN: Final = 12
"""px; from the panel to the page's edges."""

_WIDTH: Final = 330
"""px; of the panel."""

_NARROW: Final = 850
"""px; pages below this width begin with the panel folded."""

_KEY_NAMES: Final = {
    "up": "UpArrow",
    "down": "DownArrow",
    "left": "LeftArrow",
    "right": "RightArrow",
    "space": "Space",
    "enter": "Enter",
    "backspace": "Backspace",
}
"""Names of Dear ImGui; letters are their own."""

CLICK: Final = "click"
"""Among the keys: what a click on the ground does."""

_CLICK_TELLS: Final = "shift + click"


@dataclasses.dataclass(frozen=True)
class PressEvent(messages.Event):
    """A key was pressed."""

    key: str


@dataclasses.dataclass(frozen=True)
class ChangeEvent(messages.Event):
    """A widget was set; changes are numbered from 1."""

    number: int
    name: str
    value: Setting


@dataclasses.dataclass(frozen=True)
class PointEvent(messages.Event):
    """The ground was clicked on, mm."""

    x_w: float
    y_w: float


@dataclasses.dataclass(frozen=True)
class CameraSnapshot(messages.Snapshot):
    """From where it is seen now."""

    camera: mujoco.MjvCamera


@dataclasses.dataclass(frozen=True)
class PanelSnapshot(messages.Snapshot):
    """Sections of the panel and the line beside it, up to the change of a number."""

    sections: tuple[Section, ...]
    hint: str
    latest_change: int


@dataclasses.dataclass(frozen=True)
class AimEvent(messages.Event):
    """The scene is another: what the camera follows is that of this one."""

    camera: mujoco.MjvCamera


@dataclasses.dataclass(frozen=True)
class LeaveEvent(messages.Event):
    """Nobody is connected any more."""


class Desk(plugin.ViewerPlugin):
    """Draws the panel at the left of the page; sends what a person does.

    At the left, since the width of the page is only known some pictures after it was opened.

    Parameters
    ----------
    title
        Of the panel.
    keys
        Name of a key -> what a press does, in a few words; `CLICK` is a click on the ground.
    """

    def __init__(self, title: str, keys: Mapping[str, str]) -> None:
        self._title = title
        self._keys = {
            name: getattr(imgui.Key, _KEY_NAMES.get(name, name.upper()))
            for name in keys
            if name != CLICK
        }
        self._help = Section(
            "Keys and mouse",
            (
                *(
                    Line(f"{_CLICK_TELLS if name == CLICK else name}: {tells}")
                    for name, tells in keys.items()
                ),
                Line("drag: turn the view;  wheel: nearer, farther"),
            ),
        )
        self._sections: tuple[Section, ...] = ()
        self._hint = ""
        self._latest_change = 0
        self._awaited: dict[str, tuple[int, Setting]] = {}
        self._camera_told: tuple[Any, ...] = ()
        self._is_narrow = False
        self._forgets = False
        self._height = math.inf
        self._is_closed = False

    @messages.handler
    def on_panel(self, snapshot: PanelSnapshot) -> None:
        """Show this from now on, but for what a person has changed since."""
        self._awaited = {
            name: (number, value)
            for name, (number, value) in self._awaited.items()
            if number > snapshot.latest_change
        }
        self._sections, self._hint = snapshot.sections, snapshot.hint

    @messages.handler
    def on_aim(self, event: AimEvent) -> None:
        """Follow the new scene's body, from where a person looks."""
        camera = self.viewer.camera
        for name in ("type", "trackbodyid", "fixedcamid"):
            setattr(camera, name, getattr(event.camera, name))

    @messages.handler
    def on_leave(self, event: LeaveEvent) -> None:
        """Forget keys that are down: the page that closed never tells when they are let go."""
        self._forgets = True

    @messages.handler
    def on_gui(self, event: messages.BuildGuiEvent) -> None:
        """Draw a picture of the panel, and read keys and mouse."""
        self._tell_camera()
        io = imgui.GetIO()
        # keys are the simulation's, not for going from widget to widget
        io.ConfigFlags &= ~int(imgui.ConfigFlags.NavEnableKeyboard)
        deaf = int(imgui.ConfigFlags.NoKeyboard)
        if self._forgets:
            # for the next picture, at whose begin Dear ImGui then clears its keys; not before the
            # new page is there, since a connection sets flags itself
            io.ConfigFlags |= deaf
            self._forgets = False
        elif io.ConfigFlags & deaf:
            io.ConfigFlags &= ~deaf
        elif not io.WantCaptureKeyboard:
            self._read_keys()
        if not io.WantCaptureMouse and io.KeyShift and imgui.IsMouseClicked(imgui.MouseButton.Left):
            self._point()
        self._draw()

    def _draw(self) -> None:
        page = imgui.GetIO().DisplaySize
        always = int(imgui.Cond.Always)
        is_narrow = page.x < _NARROW
        if is_narrow != self._is_narrow or self._is_closed:
            imgui.SetNextWindowCollapsed(is_narrow or self._is_closed, always)
            self._is_narrow = is_narrow
        width, height = min(_WIDTH, page.x - 2 * _MARGIN), page.y - 2 * _MARGIN
        imgui.SetNextWindowPos(imgui.Vec2(_MARGIN, _MARGIN), always)
        imgui.SetNextWindowSize(imgui.Vec2(width, min(height, self._height)), always)
        flags = imgui.WindowFlags
        fixed = (flags.NoResize, flags.NoMove, flags.NoSavedSettings, flags.NoDocking)
        is_unfolded, is_open = imgui.Begin(self._title, True, sum(map(int, fixed)))
        if is_unfolded:
            for section in (*self._sections, self._help):
                widgets = tuple(self._as_set(widget) for widget in section.widgets)
                for name, value in draw_section(section._replace(widgets=widgets)):
                    self._change(name, value)
            # as high as what it holds, from the next picture on
            self._height = imgui.GetCursorPosY() + _MARGIN
        # closed it would not come back: then it is folded
        self._is_closed = not is_open
        imgui.End()
        if not is_narrow:
            self._draw_hint(width + 2 * _MARGIN, _MARGIN)
        elif not is_unfolded:
            self._draw_hint(_MARGIN, 2 * _MARGIN + imgui.GetFrameHeight())

    def _draw_hint(self, x: float, y: float) -> None:
        imgui.SetNextWindowPos(imgui.Vec2(x, y), int(imgui.Cond.Always))
        flags = imgui.WindowFlags
        plain = (flags.NoDecoration, flags.NoInputs, flags.NoNav, flags.NoDocking)
        more = (flags.AlwaysAutoResize, flags.NoSavedSettings, flags.NoFocusOnAppearing)
        imgui.Begin("hint", None, sum(map(int, (*plain, *more))))
        imgui.Text(self._hint)
        imgui.End()

    def _change(self, name: str, value: Setting) -> None:
        self._latest_change += 1
        self._awaited[name] = (self._latest_change, value)
        self.viewer.send_to_sim(ChangeEvent(self._latest_change, name, value))

    def _as_set(self, widget: Any) -> Any:
        """Give a widget the value that a person has set, while the simulation has yet to hear."""
        if getattr(widget, "name", None) not in self._awaited:
            return widget
        _, value = self._awaited[widget.name]
        field = next((field for field in ("value", "is_on") if hasattr(widget, field)), None)
        return widget if field is None else widget._replace(**{field: value})

    def _read_keys(self) -> None:
        for name, key in self._keys.items():
            # Not IsKeyDown: that stays true when a page closes with the key held.
            if imgui.IsKeyPressed(key, False):
                self.viewer.send_to_sim(PressEvent(name))

    def _point(self) -> None:
        io, viewer = imgui.GetIO(), self.viewer
        width, height = io.DisplaySize.x, io.DisplaySize.y
        view = camera_view(viewer.model, viewer.data, viewer.camera)
        if view is None or not height:
            return
        place = ground_point(view, io.MousePos.x / width, io.MousePos.y / height, width / height)
        if place is not None:
            viewer.send_to_sim(PointEvent(*place))

    def _tell_camera(self) -> None:
        camera = self.viewer.camera
        seen = (*camera.lookat, camera.azimuth, camera.elevation, camera.distance)
        if seen != self._camera_told:
            self._camera_told = seen
            self.viewer.send_to_sim(CameraSnapshot(copy.copy(camera)))
