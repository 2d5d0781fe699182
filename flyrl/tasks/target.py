"""Target: steer to a point some mm away, in any direction, in time."""

from functools import partial
from typing import Annotated, Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import MOST_DRAWS, TIME, Episode, draw_oscillators, draw_spawn
from flyrl.tasks.errors import error
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import SUCCESS, ObservationTerm, RewardTerm, Task, Termination
from flyrl.tasks.terms import FAILURES, lost_time
from flyrl.terrains import TARGET_MARKER, Bounds, Terrain
from flyrl.validation import Within, ordered

BOUNDS_MARGIN: Final = 1.5
"""mm; no target lies closer to the terrain's edge."""


def is_inside(x: float, y: float, bounds: Bounds) -> bool:
    """Whether a target may lie there: on the terrain, and not too close to its edge."""
    margin = BOUNDS_MARGIN
    return (
        bounds.x_min + margin <= x <= bounds.x_max - margin
        and bounds.y_min + margin <= y <= bounds.y_max - margin
    )


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    distance: tuple[float, float],
    bearing: float,
) -> Episode:
    """Draw a spawn, a target on the terrain (uniform bearing and distance) and the CPG's start.

    With the difficulty, the bearings grow from straight ahead to all that are allowed, and the
    largest distance from the smallest.

    Parameters
    ----------
    distance
        Least and greatest, mm.
    bearing
        Greatest to either side of the x axis, deg.
    """
    nearest, farthest = distance
    farthest = nearest + difficulty * (farthest - nearest)
    widest = difficulty * np.deg2rad(bearing)
    rng = np.random.default_rng(seed)
    spawn = draw_spawn(terrain, rng)
    bounds = terrain.bounds
    goal = draw_target(rng, spawn[:2], bounds, (nearest, farthest), widest)
    phases, magnitudes = draw_oscillators(seed)
    return Episode(seed, spawn, 0.0, goal, phases, magnitudes, difficulty=difficulty)


def draw_target(
    rng: np.random.Generator,
    start: tuple[float, float],
    bounds: Bounds,
    distances: tuple[float, float],
    widest: float = np.pi,
) -> tuple[float, float]:
    """Draw a target on a terrain: x and y, mm.

    Parameters
    ----------
    start
        From where distance and bearing are drawn, mm.
    distances
        Nearest and farthest, mm.
    widest
        Largest bearing to either side of the x axis, rad.

    Raises
    ------
    ValueError
        If the terrain has no room for it.
    """
    for _ in range(MOST_DRAWS):
        distance, bearing = rng.uniform(*distances), rng.uniform(-widest, widest)
        x = start[0] + distance * np.cos(bearing)
        y = start[1] + distance * np.sin(bearing)
        if is_inside(x, y, bounds):
            return float(x), float(y)
    raise ValueError(
        f"task.distance must leave a target room on the terrain, of x from {bounds.x_min:g} to "
        f"{bounds.x_max:g} and y from {bounds.y_min:g} to {bounds.y_max:g} mm, got {distances}"
    )


@TaskFunction
def target(
    distance: Annotated[tuple[float, float], Within(0, 1000)] = (5.0, 15.0),
    bearing: Annotated[float, Within(0, 180)] = 180.0,
    reach: Annotated[float, Within(1e-3, 1000)] = 1.0,
    time_limit: Annotated[float, TIME] = 3.0,
) -> Task:
    """Steer to a target.

    Parameters
    ----------
    distance
        Least and greatest distance of the target from the start, mm.
    bearing
        Greatest bearing of the target to either side of the heading at the start, deg.
    reach
        The target is reached within this horizontal distance of the thorax, mm.
    time_limit
        s until the episode is cut off.
    """
    near, far = ordered("task.distance", distance)
    if reach >= near:
        raise ValueError(f"task.reach must be below the least task.distance, {near}, got {reach}")
    at_target = partial(terms.is_at_target, reach=reach)
    return Task(
        observation=(
            ObservationTerm(
                "target_direction", (2,), -1.0, 1.0, terms.target_direction_b,
                "cos and sin of the target's bearing from the heading, left positive",
                is_bearing=True,
            ),
            ObservationTerm(
                "target_distance", (1,), 0.0, 4.0, terms.target_distance,
                "horizontal distance to the target, in 15 mm",
            ),
            *SENSES,
        ),
        reward=(
            RewardTerm("progress", 0.2, terms.progress, "mm closer to the target"),
            RewardTerm(
                "success", 2.0, partial(terms.reached, reach=reach), "the target is reached"
            ),
            RewardTerm("time", -0.5, terms.elapsed, "s gone by"),
            # no failure may save the time that it cuts off
            lost_time(-0.5),
        ),
        terminations=(Termination(SUCCESS, at_target), *FAILURES),
        time_limit_s=time_limit,
        props=(TARGET_MARKER,),
        sample_episode=partial(sample_episode, distance=distance, bearing=bearing),
        difficulty=f"distance of the target, from {near:g} mm to {near:g}-{far:g}, and its "
        f"bearing, from 0 to ±{bearing:g}°",
        success=f"thorax within {reach:g} mm of the target",
        errors=(error("heading_error_deg", 180.0, terms.turn_to_target),),
    )  # fmt: skip
