"""A task of one's own: visit sources of food, one after the other, in time.

    python train.py task=examples.forage:forage task.sources=2
    python evaluate.py task=examples.forage:forage policies=[<run folder>]

The function below is all there is: its parameters are settings, its annotations say what is
allowed, and it returns the table of the task.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks import (
    FAILURES,
    SUCCESS,
    Episode,
    ErrorTerm,
    ObservationTerm,
    RewardTerm,
    Task,
    TaskState,
    Termination,
    terms,
)
from flyrl.tasks.hybrid_turning import sample_episode
from flyrl.tasks.senses import SENSES
from flyrl.tasks.target import draw_target
from flyrl.tasks.terms import lost_time
from flyrl.terrains import Prop, Terrain
from flyrl.validation import Within

Array = NDArray[np.float64]

SOURCE_RADIUS = 0.3
"""mm; so large is a source seen, which a fly walks through."""


def draw_sources(
    terrain: Terrain, seed: int, difficulty: float = 1.0, *, sources: int, apart: float
) -> Episode:
    """Draw a spawn and a chain of sources, each so many mm from the one before."""
    episode = sample_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    places = [episode.spawn_position_w[:2]]
    for _ in range(sources):
        places.append(draw_target(rng, places[-1], terrain.bounds, (apart, apart)))
    height = terrain.base_height + SOURCE_RADIUS
    return replace(
        episode,
        command=tuple(value for place in places[1:] for value in place),
        props=tuple(value for x, y in places[1:] for value in (x, y, height)),
    )


def _found(state: TaskState) -> NDArray[np.intp]:
    """Number of sources found before this decision, (n,)."""
    return np.round(state.totals["found"]).astype(np.intp)


def _next(state: TaskState) -> Array:
    """Place of the source that is due, mm, (n, 2); at the end the last one."""
    places = state.command.reshape(len(state.command), -1, 2)
    due = np.minimum(_found(state), places.shape[1] - 1)
    chosen: Array = places[np.arange(len(places)), due]
    return chosen


def has_all(state: TaskState, sources: int) -> NDArray[np.bool_]:
    """Whether all sources are found, (n,)."""
    return np.asarray(_found(state) >= sources)


def missing(state: TaskState, sources: int) -> Array:
    """Number of sources that are not found, (n,)."""
    return np.asarray(sources - state.totals["found"])


def forage(
    sources: Annotated[int, Within(1, 20)] = 3,
    apart: Annotated[float, Within(2, 100)] = 5.0,
    reach: Annotated[float, Within(0.1, 2)] = 1.0,
    time_limit: Annotated[float, Within(0.1, 600)] = 5.0,
) -> Task:
    """Visit a number of sources, each `apart` mm from the one before, in turn."""
    # terms of the target, which is the source that is due
    direction = partial(terms.target_direction_b, place=_next)
    progress = partial(terms.progress, place=_next)
    found = partial(terms.is_at_target, reach=reach, place=_next)
    return Task(
        observation=(
            ObservationTerm(
                "target_direction", (2,), -1.0, 1.0, direction,
                "cos and sin of the bearing of the source that is due, left positive",
                is_bearing=True,
            ),
            *SENSES,
        ),
        reward=(
            RewardTerm("progress", 0.2, progress, "mm closer to the source that is due"),
            RewardTerm("found", 1.0, found, "a source is reached"),
            lost_time(-0.5),
        ),
        terminations=(Termination(SUCCESS, partial(has_all, sources=sources)), *FAILURES),
        sample_episode=partial(draw_sources, sources=sources, apart=apart),
        props=tuple(
            Prop(f"source_{i}", "sphere", (SOURCE_RADIUS,), (0.95, 0.75, 0.1, 1.0))
            for i in range(1, sources + 1)
        ),
        time_limit_s=time_limit,
        success=f"{sources} sources reached within {reach:g} mm, in turn",
        errors=(
            ErrorTerm(
                "sources_missed", sources, partial(missing, sources=sources),
                "sources that are not found yet, mean over the episode", smallest_effect=0.25,
            ),
        ),
        decisive=("success", "sources_missed"),
        compared=("time_to_goal_s",),
    )  # fmt: skip
