"""Figures of paths seen from above, over the ground where it is rough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from flyrl.evaluation.episodes import Json, Trajectory
from flyrl.report.style import INK, MUTED, colours, episode_url, outcome_dot, panels
from flyrl.report.wording import outcome_name
from flyrl.tasks import SUCCESS, Episode
from flyrl.terrains import NOWHERE, Bounds, Ground, Terrain, terrain_on_record
from flyrl.validation import FloatArray

MAX_PATHS: Final = 60
"""Paths drawn per controller; more are a smear."""

COLUMNS: Final = 3
"""Panels side by side."""

MARGIN: Final = 2.0
"""Distance between what is shown and the edge of the view, mm, about the length of a fly."""

LEAST_VIEW: Final = 8.0
"""Least width and height of a view, mm."""

_SHORT_NAME: Final = 18
"""Characters of a name that stands beside the count of successes in full size."""

_PANEL_IN: Final = (2.8, 3.6)
"""Width of a panel, and its largest height, inches."""

LEVELS: Final = 6
"""Shades of ground from the lowest to the highest, evenly spaced; so few make small pictures."""

GROUND_SHADES: Final = (0.15, 0.5)
"""Opacity of the lowest ground and of the highest; gaps are bare."""

PIXELS: Final = 500
"""Size of a picture of the ground along its longer side, px."""


class Thing(NamedTuple):
    """A prop as it is seen from above: where it starts, (2,), its radius, mm, and its colour."""

    place: FloatArray
    radius: float
    rgb: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Walk:
    """An episode as it is drawn.

    Attributes
    ----------
    episode
        Its index on the terrain.
    path
        Of the thorax, mm, (T, 2).
    yaw
        Heading at the start, rad.
    goals
        mm, (n, 2); none without a goal.
    outcome
        How it ended.
    things
        What stood on the ground.
    """

    episode: int
    path: FloatArray
    yaw: float
    goals: FloatArray
    outcome: str
    things: Sequence[Thing] = ()


Walks = Mapping[str, Sequence[Walk]]
"""Walks of each controller; those of an empty one are not drawn, but it keeps its colour."""


def walk_of(
    index: int, trajectory: Trajectory, episode: Json, outcome: str, protocol: Json
) -> Walk:
    """A walk in the world frame, without the samples that are not finite.

    Parameters
    ----------
    index
        Of the episode on the terrain.
    episode
        As the results hold it.
    """
    path = np.asarray(trajectory.position_w[:, :2], dtype=np.float64)
    path = path[np.isfinite(path).all(axis=1)]
    goals = np.reshape(np.array(episode.get("goal", ())[:2], dtype=np.float64), (-1, 2))
    things = things_of(episode, protocol)
    return Walk(index, path, float(trajectory.yaw[0]), goals, outcome, things)


def things_of(episode: Json, protocol: Json) -> list[Thing]:
    """Props of an episode, as the results hold them; of a box, its longer side is its width."""
    things = []
    starts = np.reshape(episode.get("props", []), (-1, 3))
    for prop, start in zip(protocol.get("table", {}).get("props", []), starts, strict=False):
        radius = max(prop["size"][:2]) / 2 if prop["shape"] == "box" else prop["size"][0]
        if start[2] > NOWHERE[2]:
            things.append(Thing(start[:2], radius, tuple(prop["rgba"][:3])))
    return things


def aligned(walk: Walk) -> Walk:
    """A walk moved to start at the origin and turned until its goal, or its heading, lies ahead."""
    start, angle = walk.path[0], walk.yaw
    for goal in walk.goals:
        angle = float(np.arctan2(*(goal - start)[::-1]))
    # multiplying by it from the right turns by -angle
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return replace(
        walk,
        path=(walk.path - start) @ turn,
        goals=(walk.goals - start) @ turn,
        things=[each._replace(place=(each.place - start) @ turn) for each in walk.things],
    )


def paths_figure(walks: Walks, terrain: Json, drawn: Sequence[Json]) -> tuple[Figure | None, str]:
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
    The figure, None without a walk, and the ground in it: "none", "same" for all episodes, or
    "random", of the first episode alone.
    """
    if not any(walks.values()):
        return None, "none"
    config = terrain_on_record(terrain["config"])
    if config is None or not config.is_rough or (config.random and not drawn):
        return aligned_figure(walks, terrain["name"]), "none"
    if not config.random:
        return ground_figure(walks, config, config.draw(config.seed)), "same"
    first = Episode(**drawn[0])
    ground = config.draw(first.ground_seed, first.difficulty)
    walks = {name: [walk for walk in own if walk.episode == 0] for name, own in walks.items()}
    return ground_figure(walks, config, ground), "random"


def aligned_figure(walks: Walks, terrain: str) -> Figure:
    """Paths of every controller, a panel each, all episodes laid over one another.

    A path starts at the origin, with its goal straight ahead, to the right; without a goal it
    starts with the fly heading to the right. With goals the view keeps to their surroundings.

    Parameters
    ----------
    terrain
        Its label, for links.
    """
    walks = {name: [aligned(walk) for walk in own] for name, own in walks.items()}
    shown = [walk.goals for own in walks.values() for walk in own[:MAX_PATHS]]
    farthest = np.linalg.norm(np.concatenate(shown), axis=1).max(initial=0.0)
    figure, (first, *_) = _draw(walks, terrain, 2.25, ("along (mm)", "across (mm)"))
    if farthest > 0:
        # Flies that never turn walk far out of any useful view.
        view = np.array([-0.9, 1.5]) * farthest, np.array([-0.9, 0.9]) * farthest
        first.set(xlim=view[0], ylim=view[1])
    figure.draw_without_rendering()  # of equal aspects, the first layout leaves out titles
    return figure


def ground_figure(walks: Walks, terrain: Terrain, ground: Ground) -> Figure:
    """Paths of every controller in the world frame over the ground that they were walked on.

    Parameters
    ----------
    terrain, ground
        The terrain, and its ground in these episodes.
    """
    bounds = terrain.bounds
    view = view_of(walks, bounds)
    x, y = (view.x_min, view.x_max), (view.y_min, view.y_max)
    height = min(_PANEL_IN[0] * np.ptp(y) / np.ptp(x), _PANEL_IN[1]) + 0.4
    figure, every = _draw(walks, terrain.label, height, ("x (mm)", "y (mm)"), faint=0.6)
    sides = bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min
    picture = ground_picture(terrain, ground, view)
    for i, axes in enumerate(every):
        seen = axes.imshow(picture, extent=(*x, *y), origin="lower", interpolation="none")
        seen.set_gid(f"ground-{i}")
        corner = bounds.x_min, bounds.y_min
        axes.add_patch(Rectangle(corner, *sides, fill=False, edgecolor=MUTED))
        axes.grid(visible=False)
    every[0].set(xlim=x, ylim=y)
    return figure


def ground_picture(terrain: Terrain, ground: Ground, view: Bounds) -> FloatArray:
    """The ground within `view` from above, (rows, columns, 4): the higher, the more opaque.

    The first row lies at the least y, the first column at the least x.
    """
    sides = view.x_max - view.x_min, view.y_max - view.y_min
    grain = max(sides) / PIXELS
    x, y = (
        start + grain * (np.arange(round(side / grain), dtype=np.float64) + 0.5)
        for start, side in zip((view.x_min, view.y_min), sides, strict=True)
    )
    tops = np.full((len(y), len(x)), np.nan)
    boxes = ground.boxes
    if ground.shift is not None and (heights := terrain.heights()) is not None:
        left, forth, up = ground.shift
        tops = up + heights.at(x - left, y[:, np.newaxis] - forth)
    elif ground.floor is not None and not len(boxes.centres):
        tops[:] = ground.floor
    for centre, half_size, top in zip(boxes.centres, boxes.half_sizes, boxes.tops, strict=True):
        rows = np.flatnonzero(np.abs(y - centre[1]) <= half_size[1])
        columns = np.flatnonzero(np.abs(x - centre[0]) <= half_size[0])
        inside = np.ix_(rows, columns)
        tops[inside] = np.fmax(tops[inside], top)
    height = (tops - np.nanmin(tops)) / (np.nanmax(tops) - np.nanmin(tops) or 1.0)
    low, high = GROUND_SHADES
    shades = low + (high - low) * np.round(height * (LEVELS - 1)) / (LEVELS - 1)
    colour = np.broadcast_to(to_rgb(MUTED), (*tops.shape, 3))
    return np.dstack([colour, np.nan_to_num(shades)])


def view_of(walks: Walks, ground: Bounds) -> Bounds:
    """Extent of paths and goals, with a margin, as far as there is ground."""
    shown = [walk for own in walks.values() for walk in own[:MAX_PATHS]]
    points = np.concatenate([each for walk in shown for each in (walk.path, walk.goals)])
    low = np.maximum(points.min(axis=0), (ground.x_min, ground.y_min)) - MARGIN
    high = np.minimum(points.max(axis=0), (ground.x_max, ground.y_max)) + MARGIN
    missing = np.maximum(LEAST_VIEW - (high - low), 0) / 2
    (x_min, y_min), (x_max, y_max) = (low - missing).tolist(), (high + missing).tolist()
    return Bounds(x_min, x_max, y_min, y_max)


def _draw(
    walks: Walks, terrain: str, height: float, labels: tuple[str, str], faint: float = 0.35
) -> tuple[Figure, list[Axes]]:
    """A figure with a titled panel per controller that walked, and those panels.

    Parameters
    ----------
    height
        Of a panel, inches.
    faint
        Opacity of the paths of failures.
    """
    shade = colours(walks)
    drawn = {name: own for name, own in walks.items() if own}
    lines = -(-len(drawn) // COLUMNS)
    with panels(lines, COLUMNS, 0.4 + height * lines, sharex=True, sharey=True) as (figure, grid):
        for axes, (controller, own) in zip(grid, drawn.items(), strict=False):
            # with room for the count
            size = 10 if len(controller) <= _SHORT_NAME else 7
            axes.set_title(f"{controller}  ", fontweight="bold", fontsize=size)
            reached = sum(walk.outcome == SUCCESS for walk in own)
            text = f"{reached}/{len(own)}" if len(own) > 1 else outcome_name(own[0].outcome)
            axes.set_title(text, loc="right", color=MUTED)
            axes.set_aspect("equal")
            _draw_walks(axes, own[:MAX_PATHS], shade[controller], terrain, faint)
        for axes in grid[max(0, len(drawn) - COLUMNS) : len(drawn)]:
            axes.tick_params(labelbottom=True)  # a last line that is not full has none below
        for axes in grid[len(drawn) :]:
            axes.set_visible(False)
        middle = min(len(drawn), COLUMNS) / COLUMNS / 2
        figure.supxlabel(labels[0], x=middle, color=MUTED, fontsize=10)
        figure.supylabel(labels[1], color=MUTED, fontsize=10)
    return figure, grid[: len(drawn)]


def _draw_walks(axes: Axes, walks: Sequence[Walk], shade: str, terrain: str, faint: float) -> None:
    """Things, paths, how they ended and their goals; failures are `faint`."""
    things = [thing for walk in walks for thing in walk.things]
    axes.add_collection(
        PatchCollection(
            [Circle(tuple(thing.place), thing.radius) for thing in things],
            facecolors=[thing.rgb for thing in things],
            alpha=max(0.1, 0.6 / len(walks)),  # the fainter, the more walks there are
            linewidths=0,
            zorder=1,
        )
    )
    for walk in walks:
        alpha = 0.8 if walk.outcome == SUCCESS else faint
        axes.plot(*walk.path.T, color=shade, linewidth=0.9, alpha=alpha)
    for outcome in dict.fromkeys(walk.outcome for walk in walks):
        own = [walk for walk in walks if walk.outcome == outcome]
        ends = np.transpose([walk.path[-1] for walk in own])
        dots = axes.scatter(*ends, zorder=3, **outcome_dot(outcome, shade))
        dots.set_urls([episode_url(terrain, walk.episode) for walk in own])
    goals = np.concatenate([walk.goals for walk in walks])
    if len(goals):
        ring: Any = {"marker": "o", "s": 26, "facecolors": "none", "edgecolors": INK}
        axes.scatter(*goals.T, linewidths=0.7, alpha=0.55, zorder=2, **ring)
