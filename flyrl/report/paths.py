"""Figures of the ways that flies took, seen from above, over the ground where it is rough."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from flyrl.evaluation.episodes import Json, Trajectory
from flyrl.report.style import (
    INK,
    MUTED,
    colours,
    episode_url,
    outcome_dot,
    panels,
    svg_text,
)
from flyrl.report.wording import outcome_name
from flyrl.tasks import SUCCESS, Episode
from flyrl.terrains import NOWHERE, Bounds, Ground, Terrain, terrain_on_record
from flyrl.validation import FloatArray

Frame = tuple[FloatArray, FloatArray]
"""Origin (2,), and what turns rows that are points, less that, into the frame, (2, 2)."""

WORLD: Final[Frame] = (np.zeros(2), np.eye(2))

MAX_PATHS: Final = 60
"""Paths drawn per controller; more are a smear."""

COLUMNS: Final = 3
"""Panels side by side."""

MARGIN: Final = 2.0
"""mm between what is shown and the edge of the view, about the length of a fly."""

LEAST_VIEW: Final = 8.0
"""Least extent of a view either way, mm."""

_SHORT_NAME: Final = 18
"""Characters of a name that stands beside the count of successes in full size."""

_PANEL_IN: Final = (2.8, 3.6)
"""Width of a panel, and its largest height, inches."""

LEVELS: Final = 6
"""Shades of ground from the lowest to the highest, evenly spaced; so few make small pictures."""

GROUND_SHADES: Final = (0.15, 0.5)
"""Opacity of the lowest ground and of the highest; gaps are bare."""

PIXELS: Final = 500
"""Of a picture of the ground, along its longer side."""


class Thing(NamedTuple):
    """A prop as it is seen from above: where it starts, how wide it is, mm, and its colour."""

    x: float
    y: float
    radius: float
    rgb: tuple[float, float, float]


def things_of(episode: Json, protocol: Json) -> tuple[Thing, ...]:
    """Props of an episode, as the results hold them."""
    props = protocol.get("table", {}).get("props", [])
    starts = np.reshape(episode.get("props", []), (-1, 3))
    return tuple(
        Thing(float(x), float(y), _radius(prop), tuple(prop["rgba"][:3]))
        for prop, (x, y, z) in zip(props, starts, strict=False)
        if z > NOWHERE[2]
    )


def _radius(prop: Json) -> float:
    """Half of a prop's width from above, mm; of a box, of its longer side."""
    return max(prop["size"][:2]) / 2 if prop["shape"] == "box" else float(prop["size"][0])


@dataclass(frozen=True, eq=False)
class Walk:
    """What is drawn of an episode.

    Attributes
    ----------
    episode
        Its index on the terrain.
    path
        In the world frame.
    goal
        (x, y) in the world frame, mm, or ().
    outcome
        How it ended.
    things
        What stood on the ground.
    """

    episode: int
    path: Trajectory
    goal: Sequence[float]
    outcome: str
    things: tuple[Thing, ...] = ()


Walks = Mapping[str, Sequence[Walk]]
"""Of each controller; those of an empty one are not drawn, but it keeps its colour."""


def paths_figure(walks: Walks, terrain: Json, drawn: Sequence[Json]) -> tuple[str, str]:
    """Figure of the paths on a terrain, over a drawing of its ground where it is rough.

    Parameters
    ----------
    walks
        Of all controllers.
    terrain
        Entry of the protocol: `name` and `config`.
    drawn
        Episodes as they were drawn there; random ground is drawn for the first one.

    Returns
    -------
    The figure, empty without a walk, and the ground in it: "none", "same" for all episodes, or
    "random", of the first episode alone.
    """
    if not any(walks.values()):
        return "", "none"
    config = terrain_on_record(terrain["config"])
    if config is None or not config.is_rough or (config.random and not drawn):
        return aligned_figure(walks, terrain["name"]), "none"
    if not config.random:
        return ground_figure(walks, config, config.draw(config.seed)), "same"
    first = Episode(**drawn[0])
    ground = config.draw(first.ground_seed, first.difficulty)
    walks = {name: [walk for walk in own if walk.episode == 0] for name, own in walks.items()}
    return ground_figure(walks, config, ground), "random"


def aligned_figure(walks: Walks, terrain: str) -> str:
    """Paths of every controller, a panel each, all episodes laid over one another.

    A path starts at the origin, with its goal straight ahead, to the right; without a goal it
    starts with the fly heading to the right. With goals the view keeps to their surroundings.

    Parameters
    ----------
    terrain
        Its label, for ids and links.
    """
    shown = [walk for own in walks.values() for walk in own[:MAX_PATHS] if len(walk.goal)]
    goals = [np.subtract(walk.goal[:2], finite(walk.path)[0]) for walk in shown]
    farthest = max((float(np.linalg.norm(goal)) for goal in goals), default=0.0)
    with _panels(walks, 2.25, ("along (mm)", "across (mm)")) as (figure, drawn):
        for axes, own, shade in drawn:
            frames = [start_frame(walk.path, walk.goal) for walk in own]
            _draw(axes, own, frames, shade, terrain)
            axes.grid(visible=True)
        if farthest > 0:
            # Flies that never turn walk far out of any useful view.
            figure.axes[0].set_xlim(-0.9 * farthest, 1.5 * farthest)
            figure.axes[0].set_ylim(-0.9 * farthest, 0.9 * farthest)
        figure.draw_without_rendering()  # of equal aspects, the first layout leaves out titles
        return svg_text(figure, f"paths-{terrain}")


def ground_figure(walks: Walks, terrain: Terrain, ground: Ground) -> str:
    """Paths of every controller in the world frame over the ground that they were walked on.

    Parameters
    ----------
    terrain, ground
        The terrain, and its ground in these episodes.
    """
    bounds = terrain.bounds
    view = view_of(walks, bounds)
    width, height = view.x_max - view.x_min, view.y_max - view.y_min
    panel_height = min(_PANEL_IN[0] * height / width, _PANEL_IN[1]) + 0.4
    corner = bounds.x_min, bounds.y_min
    sides = bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min
    picture = ground_picture(terrain, ground, view)
    extent = (view.x_min, view.x_max, view.y_min, view.y_max)
    with _panels(walks, panel_height, ("x (mm)", "y (mm)")) as (figure, drawn):
        for i, (axes, own, shade) in enumerate(drawn):
            seen = axes.imshow(picture, extent=extent, origin="lower", interpolation="none")
            seen.set_gid(f"ground-{i}")
            axes.add_patch(Rectangle(corner, *sides, fill=False, edgecolor=MUTED))
            _draw(axes, own, [WORLD] * len(own), shade, terrain.label, faint=0.6)
        figure.axes[0].set_xlim(view.x_min, view.x_max)
        figure.axes[0].set_ylim(view.y_min, view.y_max)
        return svg_text(figure, f"paths-{terrain.label}")


def ground_picture(terrain: Terrain, ground: Ground, view: Bounds) -> FloatArray:
    """The ground within `view` from above, (rows, columns, 4): the higher, the more opaque.

    The first row lies at the least y, the first column at the least x.
    """
    x_side, y_side = view.x_max - view.x_min, view.y_max - view.y_min
    grain = max(x_side, y_side) / PIXELS
    x, y = (
        start + grain * (np.arange(round(side / grain), dtype=np.float64) + 0.5)
        for start, side in ((view.x_min, x_side), (view.y_min, y_side))
    )
    tops = np.full((len(y), len(x)), np.nan)
    boxes = ground.boxes
    if ground.shift is not None and (heights := terrain.heights()) is not None:
        left, forth, up = ground.shift
        tops = up + heights.at(x - left, y[:, np.newaxis] - forth)
    elif ground.floor is not None and not len(boxes.centres):
        tops[:] = ground.floor
    for centre, half_size, top in zip(boxes.centres, boxes.half_sizes, boxes.tops, strict=True):
        rows, columns = (
            np.flatnonzero(np.abs(along - centre[axis]) <= half_size[axis])
            for axis, along in ((1, y), (0, x))
        )
        inside = np.ix_(rows, columns)
        tops[inside] = np.fmax(tops[inside], top)
    picture = np.empty((*tops.shape, 4))
    picture[..., :3] = to_rgb(MUTED)
    height = (tops - np.nanmin(tops)) / (np.ptp(tops[np.isfinite(tops)]) or 1.0)
    low, high = GROUND_SHADES
    shades = low + (high - low) * np.round(height * (LEVELS - 1)) / (LEVELS - 1)
    picture[..., 3] = np.nan_to_num(shades)
    return picture


def view_of(walks: Walks, ground: Bounds) -> Bounds:
    """Where paths and goals are, with a margin, as far as there is ground."""
    points = np.concatenate(
        [
            np.concatenate([finite(walk.path), np.reshape(walk.goal[:2], (-1, 2))])
            for own in walks.values()
            for walk in own[:MAX_PATHS]
        ]
    )
    low = np.maximum(points.min(axis=0), (ground.x_min, ground.y_min)) - MARGIN
    high = np.minimum(points.max(axis=0), (ground.x_max, ground.y_max)) + MARGIN
    missing = np.maximum(LEAST_VIEW - (high - low), 0) / 2
    (x_min, y_min), (x_max, y_max) = (low - missing).tolist(), (high + missing).tolist()
    return Bounds(x_min, x_max, y_min, y_max)


def start_frame(trajectory: Trajectory, goal: Sequence[float]) -> Frame:
    """Frame at the start of a path, its x axis to the goal, or ahead without one."""
    start = finite(trajectory)[0]
    angle = float(trajectory.yaw[0])
    if len(goal):
        x, y = np.asarray(goal[:2], dtype=np.float64) - start
        angle = float(np.arctan2(y, x))
    # multiplying by R from the right turns by -angle
    return start, np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def finite(trajectory: Trajectory) -> FloatArray:
    """Path (T, 2) without the samples that are not finite, mm."""
    path = np.asarray(trajectory.position_w[:, :2], dtype=np.float64)
    return path[np.isfinite(path).all(axis=1)]


@contextmanager
def _panels(
    walks: Walks, height: float, labels: tuple[str, str]
) -> Iterator[tuple[Figure, list[tuple[Axes, Sequence[Walk], str]]]]:
    """A figure with a titled panel per controller that walked, each so high, in inches.

    Of each the panel, the walks and the colour.
    """
    shade = colours(walks)
    drawn = [(name, own) for name, own in walks.items() if own]
    lines = -(-len(drawn) // COLUMNS)
    with panels(lines, COLUMNS, 0.4 + height * lines, sharex=True, sharey=True) as (figure, grid):
        for axes, (controller, own) in zip(grid, drawn, strict=False):
            # with room for the count
            size = 10 if len(controller) <= _SHORT_NAME else 7
            axes.set_title(f"{controller}  ", loc="left", fontweight="bold", fontsize=size)
            reached = sum(walk.outcome == SUCCESS for walk in own)
            text = f"{reached}/{len(own)}" if len(own) > 1 else outcome_name(own[0].outcome)
            axes.set_title(text, loc="right", color=MUTED)
            axes.set_aspect("equal")
        for axes in grid[max(0, len(drawn) - COLUMNS) : len(drawn)]:
            axes.tick_params(labelbottom=True)  # a last line that is not full has none below
        for axes in grid[len(drawn) :]:
            axes.set_visible(False)
        middle = min(len(drawn), COLUMNS) / COLUMNS / 2
        figure.supxlabel(labels[0], x=middle, color=MUTED, fontsize=10)
        figure.supylabel(labels[1], color=MUTED, fontsize=10)
        triples = [(axes, own, shade[name]) for axes, (name, own) in zip(grid, drawn, strict=False)]
        yield figure, triples


def _draw(
    axes: Axes,
    walks: Sequence[Walk],
    frames: Sequence[Frame],
    shade: str,
    terrain: str,
    faint: float = 0.35,
) -> None:
    """Things, paths, how they ended and their goals, each in its frame; failures are `faint`."""
    ends: dict[str, list[tuple[FloatArray, str]]] = {}
    goals = []
    for walk, (origin, rotation) in list(zip(walks, frames, strict=True))[:MAX_PATHS]:
        for thing in walk.things:
            x, y = (np.array([thing.x, thing.y]) - origin) @ rotation
            disc = Circle((x, y), thing.radius, color=thing.rgb, lw=0, zorder=1)
            disc.set_alpha(max(0.1, 0.6 / len(walks)))  # the fainter, the more walks there are
            axes.add_patch(disc)
        path = (finite(walk.path) - origin) @ rotation
        alpha = 0.8 if walk.outcome == SUCCESS else faint
        axes.plot(path[:, 0], path[:, 1], color=shade, linewidth=0.9, alpha=alpha)
        end = (path[-1], episode_url(terrain, walk.episode))
        ends.setdefault(walk.outcome, []).append(end)
        if len(walk.goal):
            goals.append((np.asarray(walk.goal[:2], dtype=np.float64) - origin) @ rotation)
    for outcome, own in ends.items():
        points, urls = zip(*own, strict=True)
        dots = axes.scatter(*np.transpose(points), zorder=3, **outcome_dot(outcome, shade))
        dots.set_urls(urls)
    if goals:
        ring: Any = {"marker": "o", "s": 26, "facecolors": "none", "edgecolors": INK}
        axes.scatter(*np.transpose(goals), linewidths=0.7, alpha=0.55, zorder=2, **ring)
