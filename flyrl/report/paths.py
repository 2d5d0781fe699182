"""Figures of the ways that flies took, seen from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from flyrl.evaluation.results import Json, Trajectory
from flyrl.report.ground import ground_symbol, seen_from_above
from flyrl.report.style import (
    FRAMED_STYLE,
    WIDTH_IN,
    colours,
    episode_url,
    marker,
    outcome_dot,
    svg_text,
)
from flyrl.report.wording import outcome_name
from flyrl.tasks import SUCCESS, Episode
from flyrl.terrains import NOWHERE, Bounds, Ground, Terrain, terrain_on_record

FloatArray = NDArray[np.float64]

MAX_PATHS: Final = 60
"""Paths drawn per controller; more are a smear."""

COLUMNS: Final = 3
"""Panels side by side."""

MARGIN: Final = 2.0
"""mm between what is shown and the edge of the view, about the length of a fly."""

LEAST_VIEW: Final = 8.0
"""Least extent of a view either way, mm."""

_PANEL_IN: Final = (2.8, 3.6)
"""Width of a panel, and its largest height, inches."""


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


def paths_section(walks: Walks, terrain: Json, drawn: Sequence[Json]) -> Json | None:
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
    The `figure`, and the `ground` in it: "none", "same" for all episodes, or "random", of the
    first episode alone. None without a walk.
    """
    if not any(walks.values()):
        return None
    config = terrain_on_record(terrain["config"])
    if config is None or not config.is_rough or (config.random and not drawn):
        return {"figure": Markup(aligned_figure(walks, terrain["name"])), "ground": "none"}
    ground = config.draw(config.seed)
    if config.random:
        first = Episode.from_record(drawn[0])
        ground = config.draw(first.ground_seed, first.difficulty)
        walks = {
            controller: [walk for walk in own if walk.episode == 0]
            for controller, own in walks.items()
        }
    figure = ground_figure(walks, config, ground)
    return {"figure": Markup(figure), "ground": "random" if config.random else "same"}


def aligned_figure(walks: Walks, terrain: str) -> str:
    """Paths of every controller, a panel each, all episodes laid over one another.

    A path starts at the origin, with its goal straight ahead, to the right; without a goal it
    starts with the fly heading to the right. With goals the view keeps to their surroundings.

    Parameters
    ----------
    terrain
        Its label, for ids and links.
    """
    drawn, shade = _drawn(walks), colours(list(walks))
    farthest = 0.0
    with mpl.rc_context(FRAMED_STYLE):
        figure, panels = _panels(drawn, 2.25)
        for (controller, own), axes in zip(drawn.items(), panels, strict=True):
            placed = [aligned(walk.path, walk.goal) for walk in own[:MAX_PATHS]]
            for walk in own[:MAX_PATHS]:
                start, rotation = _frame(walk.path, walk.goal)
                _draw_things(axes, walk.things, len(own), start, rotation)
            for _, goal in placed:
                if goal is not None:
                    farthest = max(farthest, float(np.linalg.norm(goal)))
            _draw(axes, own, placed, marker(shade[controller]), terrain)
            axes.grid(visible=True)
        if farthest > 0:
            # Flies that never turn walk far out of any useful view.
            panels[0].set_xlim(-0.9 * farthest, 1.5 * farthest)
            panels[0].set_ylim(-0.9 * farthest, 0.9 * farthest)
        _label(figure, "along (mm)", "across (mm)")
        figure.draw_without_rendering()  # of equal aspects, the first layout leaves out titles
        return svg_text(figure, f"trajectories-{terrain}")


def ground_figure(walks: Walks, terrain: Terrain, ground: Ground) -> str:
    """Paths of every controller in the world frame over the ground that they were walked on.

    Parameters
    ----------
    terrain, ground
        The terrain, and its ground in these episodes.
    """
    name = f"trajectories-{terrain.label}"
    drawn, shade = _drawn(walks), colours(list(walks))
    bounds = terrain.bounds
    view = shown(drawn, bounds)
    width, height = view.x_max - view.x_min, view.y_max - view.y_min
    with mpl.rc_context(FRAMED_STYLE):
        figure, panels = _panels(drawn, min(_PANEL_IN[0] * height / width, _PANEL_IN[1]) + 0.4)
        for i, ((controller, own), axes) in enumerate(zip(drawn.items(), panels, strict=True)):
            axes.set_gid(f"panel-{i}")
            axes.add_patch(
                Rectangle(
                    (bounds.x_min, bounds.y_min),
                    bounds.x_max - bounds.x_min,
                    bounds.y_max - bounds.y_min,
                    fill=False,
                    edgecolor=marker("muted"),
                )
            )
            for walk in own[:MAX_PATHS]:
                _draw_things(axes, walk.things, len(own), np.zeros(2), np.eye(2))
            placed = [
                (finite(walk.path), np.asarray(walk.goal[:2]) if len(walk.goal) else None)
                for walk in own[:MAX_PATHS]
            ]
            _draw(axes, own, placed, marker(shade[controller]), terrain.label, faint=0.6)
        panels[0].set_xlim(view.x_min, view.x_max)
        panels[0].set_ylim(view.y_min, view.y_max)
        _label(figure, "x (mm)", "y (mm)")
        boxes = seen_from_above(terrain, ground, view)
        symbol = ground_symbol(boxes, view, f"{name}-ground")
        return _over(svg_text(figure, name), name, panels, symbol)


def shown(walks: Walks, ground: Bounds) -> Bounds:
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


def aligned(trajectory: Trajectory, goal: Sequence[float]) -> tuple[FloatArray, FloatArray | None]:
    """Path (T, 2) and goal (2,) moved to the origin and turned to the right.

    Turned by the goal's direction from the start, or by the heading at the start without a goal.
    Samples that are not finite are left out.
    """
    start, rotation = _frame(trajectory, goal)
    placed = (finite(trajectory) - start) @ rotation
    return placed, (np.asarray(goal[:2], dtype=np.float64) - start) @ rotation if len(
        goal
    ) else None


def _frame(trajectory: Trajectory, goal: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Start (2,), and what turns rows that are points, less that, to the right, (2, 2)."""
    start = finite(trajectory)[0].copy()
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


def _drawn(walks: Walks) -> Walks:
    return {controller: own for controller, own in walks.items() if own}


def _panels(walks: Walks, height: float) -> tuple[Figure, list[Axes]]:
    """A figure with a titled panel per controller, each so high, in inches."""
    lines = -(-len(walks) // COLUMNS)
    figure = Figure(figsize=(WIDTH_IN, 0.4 + height * lines), layout="constrained")
    grid = figure.subplots(lines, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, (controller, own) in zip(grid, walks.items(), strict=False):
        axes.set_title(f"{controller}  ", loc="left", fontweight="bold")
        reached = sum(walk.outcome == SUCCESS for walk in own)
        text = f"{reached}/{len(own)}" if len(own) > 1 else outcome_name(own[0].outcome)
        axes.set_title(text, loc="right", color=marker("muted"))
        axes.set_aspect("equal")
    for axes in grid[max(0, len(walks) - COLUMNS) : len(walks)]:
        axes.tick_params(labelbottom=True)  # a last line that is not full has none below
    for axes in grid[len(walks) :]:
        axes.set_visible(False)
    return figure, list(grid[: len(walks)])


def _label(figure: Figure, x: str, y: str) -> None:
    shown = sum(axes.get_visible() for axes in figure.axes)
    middle = min(shown, COLUMNS) / COLUMNS / 2
    figure.supxlabel(x, x=middle, color=marker("muted"), fontsize=10)
    figure.supylabel(y, color=marker("muted"), fontsize=10)


def _draw(
    axes: Axes,
    walks: Sequence[Walk],
    placed: Sequence[tuple[FloatArray, FloatArray | None]],
    shade: str,
    terrain: str,
    faint: float = 0.35,
) -> None:
    """Paths as placed, how they ended and their goals; those without success are `faint`."""
    ends: dict[str, list[tuple[FloatArray, str]]] = {}
    for walk, (path, _) in zip(walks, placed, strict=False):
        alpha = 0.8 if walk.outcome == SUCCESS else faint
        axes.plot(path[:, 0], path[:, 1], color=shade, linewidth=0.9, alpha=alpha)
        end = (path[-1], episode_url(terrain, walk.episode))
        ends.setdefault(walk.outcome, []).append(end)
    for outcome, own in ends.items():
        points, urls = zip(*own, strict=True)
        x, y = np.transpose(points)
        dots = axes.scatter(x, y, zorder=3, **outcome_dot(outcome, shade))
        dots.set_urls(urls)
    if goals := [goal for _, goal in placed if goal is not None]:
        x, y = np.transpose(goals)
        axes.scatter(
            x,
            y,
            marker="o",
            s=26,
            facecolors="none",
            edgecolors=marker("ink"),
            linewidths=0.7,
            alpha=0.55,
            zorder=2,
        )


def _draw_things(
    axes: Axes, things: Sequence[Thing], num_walks: int, start: FloatArray, rotation: FloatArray
) -> None:
    """Discs where things stand, in the frame of a walk; the fainter, the more walks there are."""
    for thing in things:
        centre = (np.array([thing.x, thing.y]) - start) @ rotation
        disc = Circle(tuple(centre), thing.radius, color=thing.rgb, lw=0, zorder=1)
        disc.set_alpha(max(0.1, 0.6 / num_walks))
        axes.add_patch(disc)


def _over(svg: str, name: str, panels: Sequence[Axes], symbol: str) -> str:
    """Lay a symbol under each panel of a figure that has been drawn; it stands there but once."""
    for panel in panels:
        figure = panel.get_figure(root=True)
        assert figure is not None
        width, height = 72 * figure.get_size_inches()
        box = panel.get_position()
        place = (
            f'x="{box.x0 * width:.2f}" y="{(1 - box.y1) * height:.2f}" '
            f'width="{box.width * width:.2f}" height="{box.height * height:.2f}"'
        )
        start = f'<g id="{name}-{panel.get_gid()}">'
        svg = svg.replace(start, f'{start}<use href="#{name}-ground" {place}/>', 1)
    head, rest = svg.split(">", 1)
    return f"{head}>{symbol}{rest}"
