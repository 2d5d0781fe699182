"""The panel in Dear ImGui: it draws controls and readings, and notes what a person changes."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from mujoco.studio.dear_imgui import dear_imgui as imgui
from numpy.typing import NDArray

Setting = float | str | bool | int
"""Value that a person gives a control."""

_LABELS: Final = 0.42
"""Share of the width that labels take."""

_SMALL: Final = 0.82
"""Size of the letters beside small drawings."""

_RADIUS: Final = 17
"""Of a dial, px."""

_GAP: Final = 6
"""Between drawings, px."""

_FEW: Final = 12
"""Bars that are given a row each; more stand side by side."""

_INK: Final = (0.25, 0.62, 0.92, 1.0)
"""Red, green, blue, alpha of hands, and of filled rectangles of a raster."""

_RED: Final = (0.78, 0.09, 0.09, 1.0)
"""The same of bars."""


class Panel:
    """Controls and readings in Dear ImGui's current window.

    Each control has a name, under which its change comes, and a label.

    Attributes
    ----------
    changes
        Name of a control -> what a person has set it to in this picture.
    """

    def __init__(self) -> None:
        self.changes: dict[str, Setting] = {}
        self._has_sections = False

    def section(self, title: str, is_open: bool = True) -> bool:
        """Begin a section; return whether it is unfolded, as only then its content is drawn."""
        if self._has_sections:
            imgui.Spacing()
        self._has_sections = True
        flags = imgui.TreeNodeFlags.DefaultOpen if is_open else 0
        return bool(imgui.CollapsingHeader(title, int(flags)))

    def text(self, text: str) -> None:
        """Write a line, wrapped."""
        imgui.PushTextWrapPos(0.0)
        imgui.TextUnformatted(text)
        imgui.PopTextWrapPos()

    def slider(self, name: str, label: str, low: float, high: float, value: float) -> None:
        """Control of a number between two others."""
        _label(label)
        flags = int(imgui.SliderFlags.AlwaysClamp)
        changed, chosen = imgui.SliderFloat(f"##{name}", value, low, high, "%.2f", flags)
        self._note(name, changed, float(chosen))

    def choice(self, name: str, label: str, options: tuple[str, ...], value: str) -> None:
        """Control of one of several texts."""
        _label(label)
        current = options.index(value) if value in options else -1
        changed, chosen = imgui.Combo(f"##{name}", current, list(options))
        self._note(name, changed, options[chosen])

    def switch(self, name: str, label: str, is_on: bool) -> None:
        """Control that is on or off."""
        changed, chosen = imgui.Checkbox(f"{label}##{name}", is_on)
        self._note(name, changed, bool(chosen))

    def integer(self, name: str, label: str, value: int) -> None:
        """Control of a whole number."""
        _label(label)
        changed, chosen = imgui.InputInt(f"##{name}", value)
        self._note(name, changed, int(chosen))

    def buttons(self, labels: Mapping[str, str]) -> None:
        """Buttons in a line, name -> label; a press gives True."""
        for number, (name, label) in enumerate(labels.items()):
            if number:
                imgui.SameLine()
            # the name alone tells buttons apart, as a label may change while it is pressed
            self._note(name, imgui.Button(f"{label}###{name}"), True)

    def values(self, values: Mapping[str, float]) -> None:
        """Numbers below each other, by label."""
        right = imgui.GetCursorPosX() + imgui.GetContentRegionAvail().x
        for label, value in values.items():
            imgui.TextUnformatted(label)
            places = 0 if isinstance(value, int) else 3 if abs(value) < 10 else 1
            text = f"{round(value, places) + 0.0:.{places}f}"  # -0.0 becomes 0.0
            imgui.SameLine(right - imgui.CalcTextSize(text).x)
            imgui.TextUnformatted(text)

    def bars(self, shares: Mapping[str, float]) -> None:
        """Bars from 0 to 1, by label; many stand side by side."""
        labels = list(shares)
        columns = 1 if len(labels) <= _FEW else 2
        rows = -(-len(labels) // columns)
        imgui.PushStyleColor(int(imgui.Col.PlotHistogram), imgui.Vec4(*_RED))
        if imgui.BeginTable(f"##bars of {labels}", columns):
            with _small_letters():
                indent = max(imgui.CalcTextSize(label).x for label in labels) + _GAP
                for place in range(rows * columns):
                    imgui.TableNextColumn()
                    # down a column first, as one reads a list
                    row, column = divmod(place, columns)
                    if (number := column * rows + row) < len(labels):
                        label = labels[number]
                        imgui.TextUnformatted(label)
                        imgui.SameLine(0.0, indent - imgui.CalcTextSize(label).x)
                        size = imgui.Vec2(-1.0, imgui.GetTextLineHeight())
                        imgui.ProgressBar(shares[labels[number]], size, "")
            imgui.EndTable()
        imgui.PopStyleColor()

    def dials(
        self, labels: tuple[str, ...], phases: NDArray[np.float64], lengths: NDArray[np.float64]
    ) -> None:
        """Clocks in a row, whose hands point to phases, rad, with lengths from 0 to 1, (n,) each.

        Phase 0 is upright, a quarter of a turn to the right.
        """
        place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
        pitch = 2 * _RADIUS + _GAP
        with _small_letters():
            for number, label in enumerate(labels):
                x, y = place.x + number * pitch + _RADIUS, place.y + _RADIUS + 1
                hand = (_RADIUS - 2) * min(max(float(lengths[number]), 0.0), 1.0)
                right, up = hand * np.sin(phases[number]), hand * np.cos(phases[number])
                middle = imgui.Vec2(x, y)
                draw.AddCircle(middle, _RADIUS, _faint(), 24, 1.5)
                draw.AddLine(middle, imgui.Vec2(x + right, y - up), _colour(*_INK), 2.5)
                left = x - imgui.CalcTextSize(label).x / 2
                _write(draw, left, y + _RADIUS + 1, label)
            height = 2 * _RADIUS + imgui.GetTextLineHeight() + _GAP
        imgui.Dummy(imgui.Vec2(len(labels) * pitch, height))

    def raster(
        self, labels: tuple[str, ...], rows: NDArray[np.bool_], places: int, span_s: float
    ) -> None:
        """Rows of what was so over the latest seconds, the newest at the right.

        Parameters
        ----------
        labels
            Of the rows.
        rows
            (number of rows, up to `places`), oldest first.
        places
            Number that fills the span.
        span_s
            Time that all places take, s.
        """
        place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
        width = imgui.GetContentRegionAvail().x
        with _small_letters():
            pitch = imgui.GetTextLineHeight() + 1
            left = place.x + _GAP + max(imgui.CalcTextSize(label).x for label in labels)
            cell = (place.x + width - left) / places
            first = left + (places - rows.shape[1]) * cell
            for number, (label, row) in enumerate(zip(labels, rows, strict=True)):
                top = place.y + number * pitch
                _write(draw, place.x, top, label)
                edges = np.flatnonzero(np.diff(row, prepend=False, append=False)).reshape(-1, 2)
                spans = [(0, len(row), _faint())]
                spans += [(start, end, _colour(*_INK)) for start, end in edges.tolist()]
                for start, end, colour in spans:
                    draw.AddRectFilled(
                        imgui.Vec2(first + start * cell, top + 2),
                        imgui.Vec2(first + end * cell, top + pitch - 1),
                        colour,
                    )
            below = f"the latest {span_s:g} s"
            bottom = place.y + len(rows) * pitch
            _write(draw, place.x + width - imgui.CalcTextSize(below).x, bottom, below)
        imgui.Dummy(imgui.Vec2(width, (len(rows) + 1) * pitch))

    def _note(self, name: str, has_changed: bool, value: Setting) -> None:
        if has_changed:
            self.changes[name] = value


def _label(text: str) -> None:
    """Write a label to the left of a control, and give the control the rest of the line."""
    width, left = imgui.GetContentRegionAvail().x, imgui.GetCursorPosX()
    imgui.AlignTextToFramePadding()
    imgui.TextUnformatted(text)
    imgui.SameLine(left + _LABELS * width)
    imgui.SetNextItemWidth(-1.0)


def _write(draw: Any, x: float, y: float, text: str) -> None:
    draw.AddText(imgui.Vec2(x, y), imgui.GetColorU32(int(imgui.Col.Text)), text)


def _colour(red: float, green: float, blue: float, alpha: float) -> int:
    return int(imgui.GetColorU32(imgui.Vec4(red, green, blue, alpha)))


def _faint() -> int:
    """A shade between letters and their ground, in any theme."""
    ink = imgui.GetStyleColorVec4(int(imgui.Col.Text))
    return _colour(ink.x, ink.y, ink.z, 0.22)


@contextmanager
def _small_letters() -> Iterator[None]:
    imgui.SetWindowFontScale(_SMALL)
    try:
        yield
    finally:
        imgui.SetWindowFontScale(1.0)
