"""The ground seen from above, as a piece of SVG: the higher, the stronger its shade."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.report.style import marker, themed
from flyrl.terrains import Bounds, Boxes, Ground, Terrain

MAX_LEVELS: Final = 6
"""Levels of height that are drawn; more are put together to as many, evenly spaced."""

LEVEL_SHADE: Final = 0.14
"""Opacity of ground that is all of one height."""

SHADES: Final = (0.06, 0.22)
"""Opacity of the lowest and of the highest of several levels; gaps are bare."""


def levels(tops: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights from which on ground is shaded as of a level, mm, the lowest first.

    Parameters
    ----------
    tops
        Heights of the boxes' upper faces, (n,) mm, at least one.
    """
    heights = np.unique(tops.round(6))
    if len(heights) <= MAX_LEVELS:
        return heights
    return np.linspace(heights[0], heights[-1], MAX_LEVELS, endpoint=False)


def seen_from_above(terrain: Terrain, ground: Ground, view: Bounds) -> Boxes:
    """The ground within `view` as boxes; a height field is made of some that are 1 mm wide."""
    heights, (left, forth, up) = terrain.heights(), ground.shift
    if heights is None:
        return ground.boxes
    x, y = np.meshgrid(
        np.arange(np.floor(view.x_min), view.x_max) + 0.5,
        np.arange(np.floor(view.y_min), view.y_max) + 0.5,
    )
    tops = up + heights.at(x - left, y - forth)
    centres = np.stack([x, y, tops - 0.5], axis=-1).reshape(-1, 3)
    return Boxes(
        np.concatenate([ground.boxes.centres, centres]),
        np.concatenate([ground.boxes.half_sizes, np.full_like(centres, 0.5)]),
    )


def ground_symbol(boxes: Boxes, view: Bounds, name: str) -> str:
    """SVG symbol of the ground within `view`; a `use` element of that shape shows it.

    Its units are mm, its x axis is the world's, its y axis points the other way, as SVG has it. A
    level is laid over the ones below it, so that where boxes overlap, the highest shows.

    Parameters
    ----------
    boxes
        At least one.
    view
        What is shown; only boxes in it are drawn.
    name
        Id of the symbol.
    """
    heights = levels(boxes.tops)
    low, high = SHADES if len(heights) > 1 else (LEVEL_SHADE, LEVEL_SHADE)
    # one more layer lets the same share of the ground below it through
    step = 1 - ((1 - high) / (1 - low)) ** (1 / max(len(heights) - 1, 1))
    layers = [
        f'<path fill="{themed(marker("ink"))}" fill-opacity="{low if i == 0 else step:.3f}" '
        f'd="{_outlines(boxes, boxes.tops > height - 1e-6, view)}"/>'
        for i, height in enumerate(heights)
    ]
    box = _numbers(view.x_min, -view.y_max, view.x_max - view.x_min, view.y_max - view.y_min)
    return (
        f'<symbol id="{name}" viewBox="{" ".join(box)}" preserveAspectRatio="none">'
        f"{''.join(layers)}</symbol>"
    )


def _outlines(boxes: Boxes, chosen: NDArray[np.bool_], view: Bounds) -> str:
    """Path data of the chosen boxes, each a rectangle cut to the view."""
    centres, half_sizes = boxes.centres[chosen, :2], boxes.half_sizes[chosen, :2]
    low = np.maximum(centres - half_sizes, (view.x_min, view.y_min))
    high = np.minimum(centres + half_sizes, (view.x_max, view.y_max))
    seen = (high > low).all(axis=1)
    rectangles = []
    for (left, bottom), (right, top) in zip(low[seen], high[seen], strict=True):
        x, y, width, height, back = _numbers(left, -top, right - left, top - bottom, left - right)
        rectangles.append(f"M{x} {y}h{width}v{height}h{back}z")
    return "".join(rectangles)


def _numbers(*values: float) -> list[str]:
    """As short as they can be, to a micrometre."""
    return [f"{round(float(value), 3) + 0.0:g}" for value in values]
