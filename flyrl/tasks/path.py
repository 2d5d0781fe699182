"""Path: follow a smooth random path to its end, in time."""

from dataclasses import replace
from functools import partial
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, Episode, draw_inside
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import direction_term, distance_term, steering
from flyrl.tasks.task import Mask, ObservationTerm, RewardTerm, Task, TaskState, Termination
from flyrl.terrains import TARGET_MARKER, Terrain
from flyrl.validation import FloatArray, Within

PATH_SPACING: Final = 0.5
"""mm between two points of a path."""

LEFT_PATH: Final = "left_path"
"""Outcome of a fly that is off a narrow path."""


def draw_path(
    start: tuple[float, float],
    rng: np.random.Generator,
    difficulty: float,
    length: float,
    radius: float,
    smoothness: float,
) -> FloatArray:
    """Points PATH_SPACING apart from `start`, mm, (k, 2).

    With the difficulty, the first direction grows from straight ahead to any, the curves from none
    to the sharpest, and the length from half of `length`; a shorter path repeats its last point.
    """
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415 - slow to import

    steps = round(length / PATH_SPACING)
    noise = gaussian_filter1d(rng.normal(size=steps), smoothness / PATH_SPACING)
    curvature = difficulty * (noise / np.abs(noise).max() / radius)
    first = difficulty * rng.uniform(-np.pi, np.pi)
    direction = first + np.cumsum(curvature) * PATH_SPACING
    offsets = np.cumsum(np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    last = round(steps * (1 + difficulty) / 2) - 1
    offsets[last:] = offsets[last]
    return np.asarray(np.vstack([start, start + offsets * PATH_SPACING]))


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    length: float,
    radius: float,
    smoothness: float,
) -> Episode:
    """Draw a spawn, a path on the terrain that starts there, and the CPG's start.

    Raises
    ------
    ValueError
        If the terrain has no room for the path.
    """
    episode = bare_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    x, y, _ = episode.spawn_position_w

    def draw() -> tuple[FloatArray, FloatArray]:
        drawn = draw_path((x, y), rng, difficulty, length, radius, smoothness)
        return drawn, drawn

    path = draw_inside(terrain.bounds, "task.length", length, draw)
    return replace(episode, goal=tuple(path[-1].tolist()), command=tuple(path.ravel().tolist()))


def path_position(state: TaskState, position_w: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Distance to the nearest point of the path, mm, and its number, both (n,)."""
    path = state.command.reshape(len(position_w), -1, 2)
    distances = np.linalg.norm(path - position_w[:, None, :2], axis=2)
    nearest = distances.argmin(axis=1)
    return distances[np.arange(len(nearest)), nearest], nearest


def off_path(state: TaskState) -> FloatArray:
    """Distance to the path, mm, (n,)."""
    return path_position(state, state.fly.position_w)[0]


def path_direction_b(state: TaskState, look_ahead: float) -> FloatArray:
    """Unit vector to the path's point that is `look_ahead`, mm, beyond the nearest one, (n, 2)."""
    _, nearest = path_position(state, state.fly.position_w)
    path = state.command.reshape(len(nearest), -1, 2)
    ahead = np.minimum(nearest + round(look_ahead / PATH_SPACING), path.shape[1] - 1)
    return terms.direction_b(state, path[np.arange(len(nearest)), ahead])


def path_distance(state: TaskState) -> FloatArray:
    """Distance to the path in units of 5 mm, (n, 1)."""
    return off_path(state)[:, None] / 5.0


def path_progress(state: TaskState) -> FloatArray:
    """Advance of the path's nearest point, mm, (n,)."""
    _, now = path_position(state, state.fly.position_w)
    _, before = path_position(state, state.previous.position_w)
    return np.asarray((now - before) * PATH_SPACING)


def path_deviation(state: TaskState) -> FloatArray:
    """Distance to the path, times the time since the last decision, mm s, (n,)."""
    return off_path(state) * terms.elapsed(state)


def was_followed(state: TaskState, reach: float, tolerance: float) -> Mask:
    """Whether the path's end is reached, and the fly kept to the path on the way, (n,)."""
    mean_deviation = state.totals["deviation"] / np.maximum(state.fly.time, 1e-9)
    return terms.is_at_target(state, reach) & (mean_deviation <= tolerance)


def has_left_path(state: TaskState, width: float) -> Mask:
    """Whether the thorax is further than `width`, mm, from the path, (n,)."""
    return off_path(state) > width


@TaskFunction
def path(
    length: Annotated[float, Within(2, 1000)] = 24.0,
    radius: Annotated[float, Within(0.5, 1000)] = 5.0,
    smoothness: Annotated[float, Within(0.1, 1000)] = 3.0,
    look_ahead: Annotated[float, Within(0.5, 1000)] = 4.0,
    reach: Annotated[float, Within(1e-3, 1000)] = 1.0,
    tolerance: Annotated[float, Within(1e-3, 1000)] = 1.0,
    width: Annotated[float | None, Within(0.5, 1000)] = None,
    time_limit: Annotated[float, TIME] = 4.0,
) -> Task:
    """Follow a path.

    Parameters
    ----------
    length
        Length of the path, mm.
    radius
        Smallest radius of the path's curves, mm; at 10 mm/s a curve of 5 mm takes a turn of
        2 rad/s.
    smoothness
        mm along the path over which its curvature is smoothed (standard deviation).
    look_ahead
        mm along the path from its point nearest to the fly to the one that it is shown.
    reach
        The end is reached within this horizontal distance of the thorax, mm.
    tolerance
        mm from the path, mean over the episode so far: with more, the end does not count.
    width
        mm; the path is so narrow that to be off it by more ends the episode as "left_path", and
        costs what other failures cost. None: it may be left.
    time_limit
        s until the episode is cut off.
    """
    followed = partial(was_followed, reach=reach, tolerance=tolerance)
    off = () if width is None else (Termination(LEFT_PATH, partial(has_left_path, width=width)),)
    failures = (*terms.FAILURES, *off)
    return steering(
        observation=(
            direction_term(
                partial(path_direction_b, look_ahead=look_ahead),
                f"the bearing of a point {look_ahead:g} mm ahead on the path",
            ),
            ObservationTerm(
                "path_distance", (1,), 0.0, 4.0, path_distance,
                "distance to the path, in 5 mm",
            ),
            distance_term(terms.target_distance, "the path's end"),
        ),
        reward=(
            RewardTerm("progress", 0.2, path_progress, "mm along the path"),
            RewardTerm("deviation", -0.5, path_deviation, "mm from the path, times s"),
            *terms.success_in_time(followed, "the path was followed to its end", failures),
        ),
        solved=followed,
        failures=failures,
        time_limit_s=time_limit,
        props=(TARGET_MARKER,),
        sample_episode=partial(
            sample_episode, length=length, radius=radius, smoothness=smoothness
        ),
        difficulty="first direction, from 0 to ±180°, curves, from none, length, from "
        f"{length / 2:g} to {length:g} mm",
        success=f"thorax within {reach:g} mm of the path's end, having kept to the path within "
        f"{tolerance:g} mm on average",
        errors=(terms.error("path_error_mm", length, off_path),),
        decisive=("success", "path_error_mm"),
        compared=("time_to_goal_s", "path_error_mm"),
    )  # fmt: skip
