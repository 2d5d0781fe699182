"""Heading: turn to a compass heading and keep it, in spite of pushes from the side.

A success is to be on it, within a tolerance, for a part of the time.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, WALKING_SPEED, Episode
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import direction_term, steering
from flyrl.tasks.task import RewardTerm, Task
from flyrl.tasks.terms import Pair
from flyrl.terrains import Terrain
from flyrl.validation import Within, ordered


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    turn: float,
    push: Pair,
    push_times: tuple[Pair, ...],
) -> Episode:
    """Draw a spawn, a heading and pushes (all uniform), and the CPG's start.

    With the difficulty, the headings grow from straight ahead to `turn`, deg, to either side, and
    the pushes, µN, from none to their full strength.
    """
    rng = np.random.default_rng([seed, 1])
    widest = np.deg2rad(turn)
    heading = difficulty * rng.uniform(-widest, widest)
    pushes: list[float] = []
    for start, end in push_times:
        side = rng.choice([-1.0, 1.0])
        pushes += [float(rng.uniform(start, end)), float(difficulty * side * rng.uniform(*push))]
    episode = bare_episode(terrain, seed, difficulty)
    return replace(episode, command=(float(heading),), pushes=tuple(pushes))


@TaskFunction
def heading(
    turn: Annotated[float, Within(0, 180)] = 180.0,
    tolerance: Annotated[float, Within(0.1, 180)] = 15.0,
    kept: Annotated[float, TIME] = 2.0,
    push: Annotated[Pair, Within(0, 1e4)] = (4.0, 8.0),
    push_times: Annotated[tuple[Pair, ...], Within(0, 3600)] = ((1.0, 2.0), (2.5, 3.5)),
    time_limit: Annotated[float, TIME] = 4.0,
) -> Task:
    """Turn to a heading and keep it.

    Parameters
    ----------
    turn
        Greatest angle of the heading from that at the start, to either side, deg.
    tolerance
        A fly is on the heading when its own is within this angle of it, deg.
    kept
        s on the heading, in all, that make a success; turning round takes about one.
    push
        Least and greatest force of a push, to either side, µN; a fly weighs 10. By default they
        turn a walking fly by 17 to 33 degrees and shift it by 2 to 4 mm within half a second; of 24
        flies that walked straight on flat ground none fell.
    push_times
        A push starts within each of these, s.
    time_limit
        s until the episode is cut off.
    """
    weakest, strongest = ordered("task.push", push)
    for i, times in enumerate(push_times):
        ordered(f"task.push_times[{i}]", times)
    within = float(np.deg2rad(tolerance))
    return steering(
        observation=(
            direction_term(terms.commanded_direction_b, "the commanded heading from the fly's own"),
        ),
        reward=(
            RewardTerm("along_heading", 1.0, terms.time_along_heading, "s times cos of the error"),
            RewardTerm(
                "on_heading", 1.0, partial(terms.time_on_heading, tolerance=within),
                f"s within {tolerance:g} degrees",
            ),
            RewardTerm("forward", 0.02, terms.forward_way, "mm walked forward"),
            # the worst that the time cut off could have brought
            terms.lost_time(-1.0),
        ),
        time_limit_s=time_limit,
        extent_mm=WALKING_SPEED * time_limit,
        sample_episode=partial(sample_episode, turn=turn, push=push, push_times=push_times),
        difficulty=f"turn, from 0 to ±{turn:g}°, and pushes, from none to "
        f"{weakest:g}-{strongest:g} µN",
        succeeds_in_time=partial(terms.lasted, reward="on_heading", seconds=kept),
        success=f"within {tolerance:g} degrees of the heading for {kept:g} s",
        errors=(terms.error("heading_error_deg", 180.0, terms.turn_to_heading),),
        decisive=("success", "heading_error_deg"),
        compared=("heading_error_deg",),
    )  # fmt: skip
