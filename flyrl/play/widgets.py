"""Draws the widgets of a panel with Dear ImGui, and tells what a person changes."""

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from mujoco.studio.dear_imgui import dear_imgui as imgui

from flyrl.play.layout import bricks, figure, hand, runs
from flyrl.play.panel import (
    Bars,
    Button,
    Choice,
    Dials,
    Integer,
    Line,
    Raster,
    Section,
    Setting,
    Slider,
    Switch,
    Values,
    Widget,
)
from flyrl.simulation.worm_scenery import BAR_EMPTY, BAR_FRAME, BAR_RED

Change = tuple[str, Setting]
"""Name of a widget, and what it was set to."""

_LABELS: Final = 0.42
"""Share of the width that labels take."""

_SMALL: Final = 0.82
"""Size of the letters beside small drawings."""

_RADIUS: Final = 17
"""Of a dial, px."""

_GAP: Final = 6
"""Between drawings, px."""

_INK: Final = (0.25, 0.62, 0.92)
"""Red, green, blue of hands, and of filled rectangles of a raster."""


def draw_section(section: Section) -> list[Change]:
    """Draw a section, folded or not; return what a person has changed in this picture."""
    flags = imgui.TreeNodeFlags.DefaultOpen if section.is_open else 0
    if not imgui.CollapsingHeader(section.title, int(flags)):
        return []
    imgui.PushID(section.title)
    changes = []
    for index, widget in enumerate(section.widgets):
        if index and isinstance(widget, Button) and isinstance(section.widgets[index - 1], Button):
            _go_on_in_line(widget.label)
        change = draw_widget(widget, index)
        if change is not None:
            changes.append(change)
    imgui.PopID()
    imgui.Spacing()
    return changes


@functools.singledispatch
def draw_widget(widget: Widget, index: int) -> Change | None:
    """Draw a widget; return what it was changed to, if it was.

    Parameters
    ----------
    widget
        What is drawn.
    index
        Of it in its section, which tells widgets without a name apart.
    """
    raise TypeError(f"a panel cannot show {widget!r}")


@draw_widget.register
def _line(widget: Line, index: int) -> None:
    imgui.PushTextWrapPos(0.0)
    imgui.TextUnformatted(widget.text)
    imgui.PopTextWrapPos()


@draw_widget.register
def _slider(widget: Slider, index: int) -> Change | None:
    _label(widget.label)
    flags = int(imgui.SliderFlags.AlwaysClamp)
    changed, value = imgui.SliderFloat(
        f"##{widget.name}", widget.value, widget.low, widget.high, "%.2f", flags
    )
    return (widget.name, float(value)) if changed else None


@draw_widget.register
def _choice(widget: Choice, index: int) -> Change | None:
    _label(widget.label)
    options = list(widget.options)
    current = options.index(widget.value) if widget.value in options else -1
    changed, chosen = imgui.Combo(f"##{widget.name}", current, options)
    return (widget.name, options[chosen]) if changed else None


@draw_widget.register
def _switch(widget: Switch, index: int) -> Change | None:
    changed, is_on = imgui.Checkbox(f"{widget.label}##{widget.name}", widget.is_on)
    return (widget.name, bool(is_on)) if changed else None


@draw_widget.register
def _button(widget: Button, index: int) -> Change | None:
    # the name alone tells buttons apart, as a label may change while it is pressed
    pressed = imgui.Button(f"{widget.label}###{widget.name}")
    return (widget.name, True) if pressed else None


@draw_widget.register
def _integer(widget: Integer, index: int) -> Change | None:
    _label(widget.label)
    changed, value = imgui.InputInt(f"##{widget.name}", widget.value)
    return (widget.name, int(value)) if changed else None


@draw_widget.register
def _values(widget: Values, index: int) -> None:
    width = imgui.GetContentRegionAvail().x
    left = imgui.GetCursorPosX()
    for label, value in zip(widget.labels, widget.values, strict=True):
        imgui.TextUnformatted(label)
        text = figure(value)
        imgui.SameLine(left + width - imgui.CalcTextSize(text).x)
        imgui.TextUnformatted(text)


@draw_widget.register
def _bars(widget: Bars, index: int) -> None:
    columns, height = bricks(len(widget.shares))
    if not imgui.BeginTable(f"##bars{index}", columns):
        return
    with _small_letters():
        labels = widget.labels or ("",) * len(widget.shares)
        widest = max((imgui.CalcTextSize(label).x + _GAP for label in widget.labels), default=0.0)
        rows = -(-len(labels) // columns)
        for place in range(rows * columns):
            imgui.TableNextColumn()
            # down a column first, as one reads a list
            row, column = divmod(place, columns)
            which = column * rows + row
            if which < len(labels):
                _draw_bar(labels[which], widest, widget.shares[which], height)
    imgui.EndTable()


@draw_widget.register
def _dials(widget: Dials, index: int) -> None:
    place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
    width = imgui.GetContentRegionAvail().x
    with _small_letters():
        pitch = 2 * _RADIUS + _GAP
        across = max(1, int((width + _GAP) // pitch))
        below = 2 * _RADIUS + imgui.GetTextLineHeight() + _GAP
        dials = zip(widget.labels, widget.phases, widget.magnitudes, strict=True)
        for number, (label, phase, magnitude) in enumerate(dials):
            row, column = divmod(number, across)
            x = place.x + column * pitch + _RADIUS
            y = place.y + row * below + _RADIUS + 1
            right, down = hand(phase, magnitude, _RADIUS - 2)
            draw.AddCircle(imgui.Vec2(x, y), _RADIUS, _faint(), 24, 1.5)
            tip = imgui.Vec2(x + right, y + down)
            draw.AddLine(imgui.Vec2(x, y), tip, _colour(*_INK), 2.5)
            text = imgui.Vec2(x - imgui.CalcTextSize(label).x / 2, y + _RADIUS + 1)
            draw.AddText(text, imgui.GetColorU32(int(imgui.Col.Text)), label)
        rows = -(-len(widget.labels) // across)
        imgui.Dummy(imgui.Vec2(width, rows * below))


@draw_widget.register
def _raster(widget: Raster, index: int) -> None:
    place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
    width = imgui.GetContentRegionAvail().x
    with _small_letters():
        text = imgui.GetColorU32(int(imgui.Col.Text))
        pitch = imgui.GetTextLineHeight() + 1
        left = (
            place.x + _GAP + max((imgui.CalcTextSize(name).x for name in widget.labels), default=0)
        )
        span = place.x + width - left
        for number, (label, row) in enumerate(zip(widget.labels, widget.rows, strict=True)):
            top = place.y + number * pitch
            draw.AddText(imgui.Vec2(place.x, top), text, label)
            cell = span / max(1, len(row))
            for sign, colour in (("0", _faint()), ("1", _colour(*_INK))):
                for first, end in runs(row, sign):
                    _rectangle(
                        draw,
                        (left + first * cell, top + 2, left + end * cell, top + pitch - 1),
                        colour,
                    )
        below = f"the latest {widget.span_s:g} s"
        end_of_text = place.x + width - imgui.CalcTextSize(below).x
        bottom = place.y + len(widget.rows) * pitch
        draw.AddText(imgui.Vec2(end_of_text, bottom), text, below)
        imgui.Dummy(imgui.Vec2(width, (len(widget.rows) + 1) * pitch))


def _go_on_in_line(label: str) -> None:
    """Stay in the line for a button, if it has room."""
    room = imgui.GetContentRegionAvail().x
    imgui.SameLine()
    if imgui.GetContentRegionAvail().x < imgui.CalcTextSize(label).x + 2 * _GAP or room <= 0:
        imgui.NewLine()


def _label(text: str) -> None:
    """Write a label to the left of a widget, and give the widget the rest of the line."""
    width, left = imgui.GetContentRegionAvail().x, imgui.GetCursorPosX()
    imgui.AlignTextToFramePadding()
    imgui.TextUnformatted(text)
    imgui.SameLine(left + _LABELS * width)
    imgui.SetNextItemWidth(-1.0)


def _draw_bar(label: str, indent: float, share: float, height: int) -> None:
    """Draw a bar, filled from the left with red, in a thin frame, with its label before it."""
    place, draw = imgui.GetCursorScreenPos(), imgui.GetWindowDrawList()
    line = max(height + 4.0, imgui.GetTextLineHeight() if label else 0.0)
    if label:
        top = place.y + (line - imgui.GetTextLineHeight()) / 2
        draw.AddText(imgui.Vec2(place.x, top), imgui.GetColorU32(int(imgui.Col.Text)), label)
    width = imgui.GetContentRegionAvail().x
    left, right = round(place.x + indent) + 2, round(place.x + width) - 2
    top = round(place.y + (line - height) / 2)
    bottom = top + height
    filled = left + round((right - left) * min(max(share, 0.0), 1.0))
    for (x0, y0, x1, y1), shade in (
        ((left - 2, top - 2, right + 2, bottom + 2), BAR_FRAME),
        ((left, top, right, bottom), BAR_EMPTY),
        ((left, top, filled, bottom), BAR_RED),
    ):
        if x1 > x0:
            _rectangle(draw, (x0, y0, x1, y1), _colour(*(part / 255 for part in shade)))
    imgui.Dummy(imgui.Vec2(width, line))


def _rectangle(draw: Any, corners: Sequence[float], colour: int) -> None:
    x0, y0, x1, y1 = corners
    draw.AddRectFilled(imgui.Vec2(x0, y0), imgui.Vec2(x1, y1), colour)


def _colour(red: float, green: float, blue: float, alpha: float = 1.0) -> int:
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
