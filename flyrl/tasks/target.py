"""Target: steer to a point 5-15 mm away, in any direction, within 3 s."""

from typing import Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.actions import Drives
from flyrl.tasks.episode import Episode, draw_oscillators, draw_spawn
from flyrl.tasks.failures import FAILURES, lost_time
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import SUCCESS, ErrorTerm, ObservationTerm, RewardTerm, Task, Termination
from flyrl.terrains import TARGET as TARGET_MARKER
from flyrl.terrains import Bounds, Terrain

TARGET_DISTANCE: Final = (5.0, 15.0)
"""mm; nearest and farthest target."""

BOUNDS_MARGIN: Final = 1.5
"""mm; no target lies closer to the terrain's edge."""


def is_inside(x: float, y: float, bounds: Bounds) -> bool:
    """Whether a target may lie there: on the terrain, and not too close to its edge."""
    margin = BOUNDS_MARGIN
    return (
        bounds.x_min + margin <= x <= bounds.x_max - margin
        and bounds.y_min + margin <= y <= bounds.y_max - margin
    )


def sample_episode(terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
    """Draw a spawn, a target on the terrain (uniform bearing and distance) and the CPG's start.

    With the difficulty, the bearings grow from straight ahead to all around, and the largest
    distance from the smallest.
    """
    nearest, farthest = TARGET_DISTANCE
    farthest = nearest + difficulty * (farthest - nearest)
    widest = difficulty * np.pi
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
    distances: tuple[float, float] = TARGET_DISTANCE,
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
    """
    while True:
        distance, bearing = rng.uniform(*distances), rng.uniform(-widest, widest)
        x = start[0] + distance * np.cos(bearing)
        y = start[1] + distance * np.sin(bearing)
        if is_inside(x, y, bounds):
            return float(x), float(y)


TARGET: Final = Task(
    name="target",
    observation=(
        ObservationTerm(
            "target_direction", (2,), -1.0, 1.0, terms.target_direction_b,
            "cos and sin of the target's bearing from the heading, left positive", is_bearing=True,
        ),
        ObservationTerm(
            "target_distance", (1,), 0.0, 4.0, terms.target_distance,
            "horizontal distance to the target, in 15 mm",
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("progress", 0.2, terms.progress, "mm closer to the target"),
        RewardTerm("success", 2.0, terms.reached, "the target is reached"),
        RewardTerm("time", -0.5, terms.elapsed, "s gone by"),
        # no failure may save the time that it cuts off
        lost_time(-0.5),
    ),
    terminations=(
        Termination(SUCCESS, terms.is_at_target),
        *FAILURES,
    ),
    time_limit_s=3.0,
    decision_interval_s=0.02,
    actions=Drives(),
    props=(TARGET_MARKER,),
    sample_episode=sample_episode,
    difficulty="distance of the target, from 5 mm to 5-15, and its bearing, from 0 to ±180°",
    success=f"thorax within {terms.REACH:g} mm of the target",
    errors=(ErrorTerm("heading_error_deg", 180.0, terms.turn_to_target),),
)  # fmt: skip
