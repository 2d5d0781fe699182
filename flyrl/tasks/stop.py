"""Stop: walk to a place and stand there."""

from functools import partial
from typing import Annotated

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, beyond_reach
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.senses import direction_term, distance_term, steering
from flyrl.tasks.target import sample_episode
from flyrl.tasks.task import RewardTerm, Task, TaskState
from flyrl.terrains import TARGET_MARKER
from flyrl.validation import FloatArray, Within


def time_stood(state: TaskState, reach: float, tolerance: float) -> FloatArray:
    """Time since the last decision where the fly stands within reach, mm, else 0, s, (n,).

    A thorax that moves along the ground by less than `tolerance`, mm/s, on average over the
    decision, stands.
    """
    moved = terms.goal_distance(state.fly.position_w, state.previous.position_w[:, :2])
    time_s = terms.elapsed(state)
    stands = terms.is_at_target(state, reach) & (moved < tolerance * time_s)
    return np.where(stands, time_s, 0.0)


@TaskFunction
def stop(
    distance: Annotated[tuple[float, float], Within(0, 1000)] = (5.0, 15.0),
    bearing: Annotated[float, Within(0, 180)] = 180.0,
    reach: Annotated[float, Within(1e-3, 1000)] = 1.0,
    tolerance: Annotated[float, Within(1e-3, 100)] = 2.0,
    kept: Annotated[float, TIME] = 0.5,
    time_limit: Annotated[float, TIME] = 4.0,
) -> Task:
    """Walk to a place and stand there.

    Parameters
    ----------
    distance
        Least and greatest distance of the place from the start, mm.
    bearing
        Greatest bearing of the place to either side of the heading at the start, deg.
    reach
        The fly is there within this horizontal distance of its thorax, mm.
    tolerance
        A fly stands whose thorax moves by less than this, mm/s; at rest it sways by up to 1.3.
    kept
        s of standing there, in all, that make a success.
    time_limit
        s until the episode is cut off.
    """
    near, far = beyond_reach("task.distance", distance, reach)
    return steering(
        observation=(
            direction_term(terms.target_direction_b, "the place's bearing from the heading"),
            distance_term(terms.target_distance, "the place"),
        ),
        reward=(
            RewardTerm("progress", 0.2, terms.progress, "mm closer to the place"),
            RewardTerm(
                "standing", 2.0 / kept, partial(time_stood, reach=reach, tolerance=tolerance),
                f"s of standing there, slower than {tolerance:g} mm/s",
            ),
            *terms.cost_of_time(),
        ),
        solved=partial(terms.lasted, reward="standing", seconds=kept),
        time_limit_s=time_limit,
        props=(TARGET_MARKER,),
        sample_episode=partial(sample_episode, distance=distance, bearing=bearing),
        difficulty=f"distance of the place, from {near:g} mm to {near:g}-{far:g}, and its "
        f"bearing, from 0 to ±{bearing:g}°",
        success=f"thorax within {reach:g} mm of the place, slower than {tolerance:g} mm/s, for "
        f"{kept:g} s in all",
    )  # fmt: skip
