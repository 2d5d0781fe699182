"""Target: steer to a point some mm away, in any direction, in time."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.tasks import terms
from flyrl.tasks.episode import (
    TIME,
    Episode,
    beyond_reach,
    draw_inside,
    draw_oscillators,
    draw_spawn,
)
from flyrl.tasks.extension import extended
from flyrl.tasks.function import TaskFunction, variant_of
from flyrl.tasks.senses import SENSES, TIME_LEFT, direction_term, distance_term, steering
from flyrl.tasks.task import (
    ACHIEVED_GOAL,
    DECISIONS_LOST,
    DESIRED_GOAL,
    IS_FAILURE,
    SUCCESS,
    Mask,
    ObservationTerm,
    OfGoals,
    RewardTerm,
    Task,
    TaskState,
    Termination,
    as_observed,
)
from flyrl.terrains import TARGET_MARKER, Bounds, Terrain
from flyrl.validation import FloatArray, Within


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

    def draw() -> tuple[FloatArray, tuple[float, float]]:
        distance, bearing = rng.uniform(*distances), rng.uniform(-widest, widest)
        x = start[0] + distance * np.cos(bearing)
        y = start[1] + distance * np.sin(bearing)
        return np.array([[x, y]]), (float(x), float(y))

    return draw_inside(bounds, "task.distance", distances, draw)


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
    near, far = beyond_reach("task.distance", distance, reach)
    at_target = partial(terms.is_at_target, reach=reach)
    return steering(
        observation=(
            direction_term(terms.target_direction_b, "the target's bearing from the heading"),
            distance_term(terms.target_distance, "the target"),
        ),
        reward=(
            RewardTerm("progress", 0.2, terms.progress, "mm closer to the target"),
            *terms.success_in_time(at_target, "the target is reached"),
        ),
        solved=at_target,
        # a fly that has time reaches the target with less haste, at three quarters of the work
        work=-1.2e-3,
        time_limit_s=time_limit,
        props=(TARGET_MARKER,),
        sample_episode=partial(sample_episode, distance=distance, bearing=bearing),
        difficulty=f"distance of the target, from {near:g} mm to {near:g}-{far:g}, and its "
        f"bearing, from 0 to ±{bearing:g}°",
        success=f"thorax within {reach:g} mm of the target",
        errors=(terms.error("heading_error_deg", 180.0, terms.turn_to_target),),
    )


@variant_of(target)
def target_unfiltered(task: Task) -> Task:
    """Steer to a target as in version 0.1: the drive acts at once, and its change costs nothing."""
    free = {term.name: 0.0 for term in terms.SMOOTHNESS}
    seen = tuple(term for term in task.observation if term is not TIME_LEFT)
    return replace(extended(task, {}, free), observation=seen, drive_time_constant_s=0.0)


GOAL_UNIT: Final = 10.0
"""mm."""

_BOUND: Final = 10.0
"""Largest coordinate of a goal, in GOAL_UNIT: the edge of flat ground, the widest of all."""


def _place(state: TaskState) -> FloatArray:
    return state.fly.position_w[:, :2] / GOAL_UNIT


def _goal(state: TaskState) -> FloatArray:
    return state.goal / GOAL_UNIT


ACHIEVED: Final = ObservationTerm(
    ACHIEVED_GOAL, (2,), -_BOUND, _BOUND, _place, "x and y of the thorax, in 10 mm (world frame)"
)
DESIRED: Final = ObservationTerm(
    DESIRED_GOAL, (2,), -_BOUND, _BOUND, _goal, "x and y of the target, in 10 mm (world frame)"
)


def distance(achieved_goal: ArrayLike, desired_goal: ArrayLike) -> FloatArray:
    """Distance between goals (..., 2), mm, (...)."""
    offset = np.asarray(desired_goal, np.float64) - np.asarray(achieved_goal, np.float64)
    return np.asarray(GOAL_UNIT * np.hypot(offset[..., 0], offset[..., 1]))


def is_reached(achieved_goal: ArrayLike, desired_goal: ArrayLike, reach: float) -> Mask:
    """Whether goals (..., 2) lie within `reach`, mm, of each other, (...)."""
    return np.asarray(distance(achieved_goal, desired_goal) < reach)


def is_away(
    achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike, reach: float
) -> FloatArray:
    """1 where goals (..., 2) do not lie within `reach`, mm, of each other, else 0, (...)."""
    return np.asarray(~is_reached(achieved_goal, desired_goal, reach), dtype=np.float64)


def distances(achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike) -> FloatArray:
    """Distance between goals (..., 2), mm, for this decision and each that is lost, (...)."""
    return np.asarray(distance(achieved_goal, desired_goal) * (1.0 + np.asarray(lost)))


def decisions(achieved_goal: ArrayLike, desired_goal: ArrayLike, lost: ArrayLike) -> FloatArray:
    """Decisions that are lost, whatever the goals, (...)."""
    return np.asarray(lost, dtype=np.float64)


def _goals(state: TaskState) -> tuple[ArrayLike, ArrayLike]:
    """Achieved and desired goals as they are observed."""
    achieved, desired = (as_observed(get(state), -_BOUND, _BOUND) for get in (_place, _goal))
    return achieved, desired


def at_goal(state: TaskState, reach: float) -> Mask:
    """Whether the goal is reached, as the goals are observed, (n,)."""
    return is_reached(*_goals(state), reach)


def _now(state: TaskState, of_goals: OfGoals) -> FloatArray:
    """Reward of the goals as they are observed and of the decisions that are lost, (n,)."""
    return of_goals(*_goals(state), terms.decisions_lost(state))


def goal_reward(name: str, weight: float, of_goals: OfGoals, description: str) -> RewardTerm:
    """Row of the reward table of a task with goals."""
    return RewardTerm(name, weight, partial(_now, of_goals=of_goals), description, of_goals)


def compute_reward(
    task: Task, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any
) -> FloatArray:
    """Reward of having achieved a goal when another was desired, in a task with goals.

    Parameters
    ----------
    achieved_goal, desired_goal
        As they are observed, (..., size of a goal).
    info
        Info of the same decisions; `DECISIONS_LOST` counts. One dict, of numbers or of arrays
        (...), or dicts (...).

    Returns
    -------
    What the environment gives for the same goals, to the bit, (...).

    Raises
    ------
    ValueError
        A reward term that does not follow from the goals, or an `info` without the key.
    """
    lost = _of_info(info, DECISIONS_LOST)
    reward = np.zeros(np.shape(achieved_goal)[:-1])
    for term in task.reward:
        if term.of_goals is None:
            raise ValueError(
                f"the reward term {term.name!r} of {task.name} does not follow from the goals"
            )
        reward = reward + term.weight * term.of_goals(achieved_goal, desired_goal, lost)
    return reward


def compute_terminated(
    task: Task, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any
) -> Mask:
    """Whether it ends an episode to have achieved a goal when another was desired, (...).

    The parameters are those of `compute_reward`; of `info`, `IS_FAILURE` counts.

    Raises
    ------
    ValueError
        A task without goals, or an `info` without the key.
    """
    if task.is_reached is None:
        raise ValueError(f"task {task.name!r} has no goals")
    is_failure = _of_info(info, IS_FAILURE).astype(bool)
    return np.asarray(task.is_reached(achieved_goal, desired_goal) | is_failure)


def _of_info(info: Any, key: str) -> NDArray[Any]:
    """Values of a key: of one dict, or of each of several."""
    try:
        if isinstance(info, Mapping):
            return np.asarray(info[key])
        infos = np.asarray(info, dtype=object)
        return np.array([each[key] for each in infos.flat]).reshape(infos.shape)
    except (KeyError, TypeError):
        raise ValueError(
            f"info must be what step() gave for these decisions, with the key {key!r} "
            f"(of Stable-Baselines3's HerReplayBuffer: copy_info_dict=True), got {info!r:.80}"
        ) from None


@variant_of(target)
def target_goal(task: Task) -> Task:
    """Steer to a target, with goals that can be swapped afterwards."""
    reach = task.parameters["reach"]
    return replace(
        task,
        observation=(
            ACHIEVED,
            DESIRED,
            ObservationTerm(
                "compass", (2,), -1.0, 1.0, terms.compass, "cos and sin of the heading from +x"
            ),
            *SENSES,
        ),
        is_flat=False,
        reward=(
            goal_reward(
                "away", -1.0, partial(is_away, reach=reach), "1 where the target is not reached"
            ),
            goal_reward(
                "distance", 0.0, distances,
                "mm to the target, for this decision and each that a failure cuts off",
            ),
            # no failure may save the decisions that it cuts off
            goal_reward("lost_time", -1.0, decisions, "decisions left when the fly fails"),
        ),
        terminations=(Termination(SUCCESS, partial(at_goal, reach=reach)), *terms.FAILURES),
        is_reached=partial(is_reached, reach=reach),
    )  # fmt: skip
