"""Path: follow a smooth random path of 24 mm to its end, within 4 s."""

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from flyrl.tasks import hybrid_turning, terms
from flyrl.tasks.actions import Drives
from flyrl.tasks.episode import Episode
from flyrl.tasks.failures import FAILURES, lost_time
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import (
    SUCCESS,
    Array,
    ErrorTerm,
    Mask,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
)
from flyrl.terrains import TARGET as TARGET_MARKER
from flyrl.terrains import Bounds, Terrain

LENGTH: Final = 24.0
"""mm."""

SMALLEST_RADIUS: Final = 5.0
"""mm, of the path's curves; at 10 mm/s such a curve takes a turn of 2 rad/s."""

SMOOTHNESS: Final = 3.0
"""mm along the path over which its curvature is smoothed (standard deviation)."""

BOUNDS_MARGIN: Final = 1.5
"""mm; no path comes closer to the terrain's edge; a spawn is 2 mm from it at least."""

TOLERATED_DEVIATION: Final = 1.0
"""mm, mean over the episode so far: with more, the end does not count."""


def draw_path(
    start: tuple[float, float], rng: np.random.Generator, difficulty: float = 1.0
) -> Array:
    """Points PATH_SPACING apart from `start`, mm, (k, 2).

    With the difficulty, the first direction grows from straight ahead to any, the curves from none
    to the sharpest, and the length from half of LENGTH; a shorter path repeats its last point.
    """
    steps = round(LENGTH / terms.PATH_SPACING)
    noise = gaussian_filter1d(rng.normal(size=steps), SMOOTHNESS / terms.PATH_SPACING)
    curvature = difficulty * (noise / np.abs(noise).max() / SMALLEST_RADIUS)
    first = difficulty * rng.uniform(-np.pi, np.pi)
    direction = first + np.cumsum(curvature) * terms.PATH_SPACING
    offsets = np.cumsum(np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    last = round(steps * (1 + difficulty) / 2) - 1
    offsets[last:] = offsets[last]
    return np.asarray(np.vstack([start, start + offsets * terms.PATH_SPACING]))


def sample_episode(terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
    """Draw a spawn, a path on the terrain that starts there, and the CPG's start."""
    episode = hybrid_turning.sample_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    x, y, _ = episode.spawn_position_w
    while True:
        path = draw_path((x, y), rng, difficulty)
        if _is_inside(path, terrain.bounds):
            break
    end_x, end_y = (float(value) for value in path[-1])
    command = tuple(float(value) for value in path.ravel())
    return replace(episode, goal=(end_x, end_y), command=command)


def _is_inside(path: Array, bounds: Bounds) -> bool:
    low = np.array([bounds.x_min, bounds.y_min]) + BOUNDS_MARGIN
    high = np.array([bounds.x_max, bounds.y_max]) - BOUNDS_MARGIN
    return bool(((path >= low) & (path <= high)).all())


def was_followed(state: TaskState) -> Mask:
    """Whether the path's end is reached, and the fly kept to the path on the way, (n,)."""
    mean_deviation = state.totals["deviation"] / np.maximum(state.fly.time, 1e-9)
    return terms.is_at_target(state) & (mean_deviation <= TOLERATED_DEVIATION)


def followed(state: TaskState) -> Array:
    """1 where the path was followed to its end, (n,)."""
    return was_followed(state).astype(np.float64)


PATH: Final = Task(
    name="path",
    observation=(
        ObservationTerm(
            "target_direction", (2,), -1.0, 1.0, terms.path_direction_b,
            "cos and sin of the bearing of a point 4 mm ahead on the path, left positive",
            is_bearing=True,
        ),
        ObservationTerm(
            "path_distance", (1,), 0.0, 4.0, terms.path_distance, "distance to the path, in 5 mm"
        ),
        ObservationTerm(
            "target_distance", (1,), 0.0, 4.0, terms.target_distance,
            "horizontal distance to the path's end, in 15 mm",
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("progress", 0.2, terms.path_progress, "mm along the path"),
        RewardTerm("deviation", -0.5, terms.path_deviation, "mm from the path, times s"),
        RewardTerm("success", 2.0, followed, "the path was followed to its end"),
        RewardTerm("time", -0.5, terms.elapsed, "s gone by"),
        # no failure may save the time that it cuts off
        lost_time(-0.5),
    ),
    terminations=(
        Termination(SUCCESS, was_followed),
        *FAILURES,
    ),
    time_limit_s=4.0,
    decision_interval_s=0.02,
    actions=Drives(),
    props=(TARGET_MARKER,),
    sample_episode=sample_episode,
    difficulty="first direction, from 0 to ±180°, curves, from none, length, from 12 to 24 mm",
    success=f"thorax within {terms.REACH:g} mm of the path's end, having kept to the path within "
    f"{TOLERATED_DEVIATION:g} mm on average",
    errors=(ErrorTerm("path_error_mm", LENGTH, terms.off_path),),
)  # fmt: skip
