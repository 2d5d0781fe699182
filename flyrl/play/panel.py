"""What stands on the panel beside the picture: what is shown, and what a person can change.

A panel is plain data, so that whoever fills it knows nothing of the web, and whoever draws it
nothing of flies.
"""

from typing import NamedTuple


class Line(NamedTuple):
    """A line of text."""

    text: str


class Slider(NamedTuple):
    """A number between two others; a change gives a float."""

    name: str
    label: str
    low: float
    high: float
    value: float


class Choice(NamedTuple):
    """One of several texts; a change gives the text."""

    name: str
    label: str
    options: tuple[str, ...]
    value: str


class Switch(NamedTuple):
    """On or off; a change gives a bool."""

    name: str
    label: str
    is_on: bool


class Button(NamedTuple):
    """Something to do; a change gives True."""

    name: str
    label: str


class Integer(NamedTuple):
    """A whole number that can be typed, as a seed; a change gives an int."""

    name: str
    label: str
    value: int


class Values(NamedTuple):
    """Numbers with their names, one below the other."""

    labels: tuple[str, ...]
    values: tuple[float, ...]


class Bars(NamedTuple):
    """Shares from 0 to 1 as bars, one below the other; without labels they are bare."""

    labels: tuple[str, ...]
    shares: tuple[float, ...]


class Dials(NamedTuple):
    """Oscillators as hands of clocks: phase in rad, magnitude 0 to 1 as the hand's length."""

    labels: tuple[str, ...]
    phases: tuple[float, ...]
    magnitudes: tuple[float, ...]


class Raster(NamedTuple):
    """A row per label over the latest `span_s` seconds, the newest at the right.

    `rows[i]` holds a character per equal part of the span: "1" where something is so (as a foot on
    the ground), "0" where not, " " where nothing is known.
    """

    labels: tuple[str, ...]
    rows: tuple[str, ...]
    span_s: float


Widget = Line | Slider | Choice | Switch | Button | Integer | Values | Bars | Dials | Raster


class Section(NamedTuple):
    """Widgets under a title that can be folded away."""

    title: str
    widgets: tuple[Widget, ...]
    is_open: bool = True


Setting = float | str | bool | int
"""What a person has set a widget to."""
