"""Traverse: cross the ground along +x, to a finish line, in time."""

from functools import partial
from typing import Annotated

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, Episode
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import direction_term, steering
from flyrl.tasks.task import Mask, ObservationTerm, RewardTerm, Task, TaskState
from flyrl.terrains import Terrain
from flyrl.validation import FloatArray, Within


def sample_episode(
    terrain: Terrain, seed: int, difficulty: float = 1.0, *, finish_line: float
) -> Episode:
    """Draw a spawn and the CPG's start, on ground that has the finish line on it.

    Raises
    ------
    ValueError
        If it has not.
    """
    edge = terrain.bounds.x_max
    if finish_line >= edge:
        raise ValueError(
            f"task.finish_line must lie on the terrain, below x = {edge:g} mm, got {finish_line}"
        )
    return bare_episode(terrain, seed, difficulty)


def finish_distance(state: TaskState, finish_line: float) -> FloatArray:
    """Distance to the finish line at an x, mm, along +x in units of 15 mm, (n, 1)."""
    return (finish_line - state.fly.position_w[:, :1]) / terms.DISTANCE_UNIT


def turn_to_finish(state: TaskState) -> FloatArray:
    """Angle between the heading and the world's x axis, deg, (n,)."""
    return np.asarray(np.abs(np.rad2deg(state.fly.yaw)))


def has_crossed(state: TaskState, finish_line: float) -> Mask:
    """Whether the thorax is beyond an x, mm, (n,)."""
    return np.asarray(state.fly.position_w[:, 0] > finish_line)


@TaskFunction
def traverse(
    finish_line: Annotated[float, Within(3, 1e4)] = 22.0,
    time_limit: Annotated[float, TIME] = 3.0,
) -> Task:
    """Cross the ground.

    Parameters
    ----------
    finish_line
        x that the thorax must pass, mm; it starts within 2 mm of x = 0.
    time_limit
        s until the episode is cut off.
    """
    crossed = partial(has_crossed, finish_line=finish_line)
    return steering(
        observation=(
            direction_term(terms.forward_direction_b, "the bearing of the world's x axis"),
            ObservationTerm(
                "finish_distance", (1,), -4.0, 4.0,
                partial(finish_distance, finish_line=finish_line),
                "distance to the finish line along +x, in 15 mm",
            ),
        ),
        reward=(
            RewardTerm("progress", 0.2, terms.forward_progress, "mm along +x"),
            *terms.success_in_time(crossed, "the ground is crossed"),
        ),
        solved=crossed,
        time_limit_s=time_limit,
        sample_episode=partial(sample_episode, finish_line=finish_line),
        success=f"thorax beyond x = {finish_line:g} mm",
        errors=(terms.error("heading_error_deg", 180.0, turn_to_finish),),
        decisive=("advance_mm",),
        compared=("time_to_goal_s", "advance_mm", "speed_mm_s"),
    )  # fmt: skip
