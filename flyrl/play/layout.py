"""How widgets of the panel are laid out: plain numbers, in px of the page."""

import itertools
import math
from typing import Final, NamedTuple

_FEW: Final = 12
"""Bars that are given a row each."""


class Bricks(NamedTuple):
    """How bars stand: in columns, one below the other.

    Attributes
    ----------
    columns : how many.
    height : of a bar, px.
    """

    columns: int
    height: int


def bricks(number: int) -> Bricks:
    """So many bars: one or two are thick, and many are thin and stand side by side."""
    if number <= 2:
        return Bricks(1, 20)
    if number <= _FEW:
        return Bricks(1, 10)
    return Bricks(min(math.ceil(number / _FEW), 3), 8)


def runs(row: str, sign: str) -> list[tuple[int, int]]:
    """Where a row holds a sign: first and last place + 1 of every unbroken run."""
    found, place = [], 0
    for character, group in itertools.groupby(row):
        length = len(list(group))
        if character == sign:
            found.append((place, place + length))
        place += length
    return found


def hand(phase: float, magnitude: float, radius: float) -> tuple[float, float]:
    """Tip of a clock's hand from its centre, px to the right and downwards.

    Parameters
    ----------
    phase : 0 is upright, a quarter of a turn to the right; rad.
    magnitude : share of the radius; 1 at most is drawn.
    radius : of the clock, px.
    """
    length = radius * min(max(magnitude, 0.0), 1.0)
    return length * math.sin(phase), -length * math.cos(phase)


def figure(value: float) -> str:
    """Write a number, always as wide as its size asks for: whole as it is, else 3 figures or so."""
    if not math.isfinite(value):
        return "-"
    if isinstance(value, int):
        return str(value)
    places = 3 if abs(value) < 10 else 1
    # -0.0 becomes 0.0
    return f"{round(value, places) + 0.0:.{places}f}"
