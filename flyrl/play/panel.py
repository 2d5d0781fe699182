"""The panel in Dear ImGui: it draws controls and readings, and notes what a person changes."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot
from numpy.typing import NDArray

Setting = float | str | bool | int | tuple[float, float]
"""Value that a person gives a control."""

_LABELS: Final = 0.42
"""Share of the width that labels take."""

_BAR_LABELS: Final = 110.0
"""px; to the right of bars, for their labels."""

_RED: Final = (0.78, 0.09, 0.09, 1.0)
"""Red, green, blue, alpha of bars."""


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

    def section(self, title: str, is_open: bool = True) -> bool:
        """Begin a section; return whether it is unfolded, as only then its content is drawn."""
        imgui.Spacing()
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
        self._note(name, *imgui.SliderFloat(f"##{name}", value, low, high, "%.2f", flags))

    def choice(self, name: str, label: str, options: Sequence[str], value: str) -> None:
        """Control of one of several texts."""
        _label(label)
        current = options.index(value) if value in options else -1
        changed, chosen = imgui.Combo(f"##{name}", current, list(options))
        self._note(name, changed, options[chosen])

    def switch(self, name: str, label: str, is_on: bool) -> None:
        """Control that is on or off."""
        self._note(name, *imgui.Checkbox(f"{label}##{name}", is_on))

    def integer(self, name: str, label: str, value: int) -> None:
        """Control of a whole number."""
        _label(label)
        self._note(name, *imgui.InputInt(f"##{name}", value))

    def buttons(self, labels: Mapping[str, str]) -> None:
        """Buttons in a line, name -> label; a press gives True."""
        for name, label in labels.items():
            # the name alone tells buttons apart, as a label may change while it is pressed
            self._note(name, imgui.Button(f"{label}###{name}"), True)
            imgui.SameLine()
        imgui.NewLine()

    def values(self, values: Mapping[str, float]) -> None:
        """Numbers below each other, by label."""
        for label, value in values.items():
            places = 0 if isinstance(value, int) else 3 if abs(value) < 10 else 1
            _label(label)
            imgui.TextUnformatted(f"{round(value, places) + 0.0:.{places}f}")  # -0.0 becomes 0.0

    def bars(self, shares: Mapping[str, float]) -> None:
        """Bars from 0 to 1, by label."""
        imgui.PushStyleColor(int(imgui.Col.PlotHistogram), imgui.Vec4(*_RED))
        for label, share in shares.items():
            imgui.ProgressBar(share, imgui.Vec2(-_BAR_LABELS, imgui.GetTextLineHeight()), "")
            imgui.SameLine()
            imgui.TextUnformatted(label)
        imgui.PopStyleColor()

    def dials(
        self, labels: Sequence[str], phases: NDArray[np.float64], lengths: NDArray[np.float64]
    ) -> None:
        """Clocks in a row, whose hands point to phases, rad, with lengths from 0 to 1, (n,) each.

        Phase 0 is upright, a quarter of a turn to the right.
        """
        places, turn = np.arange(len(labels)), np.linspace(0.0, 2.0 * np.pi, 25)
        x, y = (-0.5, len(labels) - 0.5), (-0.5, 0.5)
        if _begin_plot("##dials", 80.0, x, y, implot.AxisFlags.NoDecorations):
            implot.SetupAxisTicks(implot.Axis.X1, places, labels)
            for place in places:
                implot.PlotLine("##rims", place + 0.45 * np.sin(turn), 0.45 * np.cos(turn))
            right, up = 0.4 * lengths * np.sin(phases), 0.4 * lengths * np.cos(phases)
            ends = np.stack([places, places + right], axis=1), np.stack([0.0 * up, up], axis=1)
            implot.PlotLine("##hands", *map(np.ravel, ends), implot.LineFlags.Segments)
            implot.EndPlot()

    def raster(
        self, labels: Sequence[str], rows: NDArray[np.bool_], places: int, span_s: float
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
        times = np.repeat(np.arange(1 - rows.shape[1], 1) * span_s / places, 2)[1:]
        x, y = (-span_s, 0.0), (-0.5, len(labels) - 0.5)
        if _begin_plot("##raster", 130.0, x, y, implot.AxisFlags.Invert):
            implot.SetupAxisTicks(implot.Axis.Y1, np.arange(len(labels)), labels)
            for place, row in enumerate(np.repeat(rows, 2, axis=1)[:, :-1]):
                implot.PlotShaded("##rows", times, place + 0.4 * row, place - 0.4 * row)
            implot.EndPlot()

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


def _begin_plot(
    title: str,
    height: float,
    x: tuple[float, float],
    y: tuple[float, float],
    y_flags: implot.AxisFlags,
) -> bool:
    """Begin a plot of a height, px, with ranges of its axes, which is only to be looked at."""
    flags = implot.Flags.CanvasOnly.value | implot.Flags.NoInputs.value
    if not implot.BeginPlot(title, imgui.Vec2(-1.0, height), flags):
        return False
    implot.SetupAxes("", "", implot.AxisFlags.NoGridLines.value, y_flags.value)
    implot.SetupAxesLimits(*x, *y, implot.Cond.Always.value)
    return True
