"""Chase: catch a target that moves along a circle, in time."""

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import TIME, Episode, beyond_reach, draw_inside
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import direction_term, distance_term, steering
from flyrl.tasks.task import ObservationTerm, RewardTerm, Task, TaskState
from flyrl.terrains import Prop, Terrain
from flyrl.validation import FloatArray, Within

COURSE_POINTS = 50
"""Number of places on the target's course that must lie on the terrain."""


def revolved(places: FloatArray, time_s: FloatArray, command: FloatArray) -> FloatArray:
    """Places (n, 3), mm, after a time (n,), s, around the centres that commands say.

    Parameters
    ----------
    command
        x and y of the centre, mm, and rate, rad/s, counter-clockwise from above, (n, 3).
    """
    centre, angle = command[:, :2], command[:, 2] * time_s
    offset = terms.to_yaw_frame(places[:, :2] - centre, -angle)
    return np.concatenate([centre + offset, places[:, 2:]], axis=1)


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    distance: tuple[float, float],
    speed: float,
    radius: float,
    time_limit: float,
) -> Episode:
    """Draw a spawn, where the target starts and in which direction, and the CPG's start.

    Bearing and direction are uniform, the circle is to its left or right. With the difficulty, the
    bearings grow from straight ahead to all, the largest distance from the smallest, mm, and the
    target's speed, mm/s, from rest.

    Raises
    ------
    ValueError
        If the terrain has no room for the target's course until the time limit, s.
    """
    episode = bare_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    nearest, farthest = distance
    farthest = nearest + difficulty * (farthest - nearest)
    turn_rate = difficulty * speed / radius
    times_s = np.linspace(0.0, time_limit, COURSE_POINTS)

    def draw() -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
        bearing, away = difficulty * rng.uniform(-np.pi, np.pi), rng.uniform(nearest, farthest)
        side, to_centre = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi)
        start = episode.spawn_position_w[:2] + away * np.array([np.cos(bearing), np.sin(bearing)])
        centre = start + radius * np.array([np.cos(to_centre), np.sin(to_centre)])
        command = np.array([*centre, side * turn_rate])
        places = np.tile((*start, terrain.base_height), (COURSE_POINTS, 1))
        course = revolved(places, times_s, np.tile(command, (COURSE_POINTS, 1)))
        return course[:, :2], (command, places[0])

    command, place = draw_inside(
        terrain.bounds,
        "task.distance, task.speed, task.radius and task.time_limit",
        (distance, speed, radius, time_limit),
        draw,
    )
    return replace(episode, command=tuple(command.tolist()), props=tuple(place.tolist()))


def target(state: TaskState) -> FloatArray:
    """Place of the target, mm, (n, 2)."""
    return state.props[:, 0, :2]


def target_velocity_b(state: TaskState) -> FloatArray:
    """Velocity of the target, forward and leftward, in units of 20 mm/s, (n, 2)."""
    offset = target(state) - state.command[:, :2]
    velocity_w = state.command[:, 2:] * np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    return terms.to_yaw_frame(velocity_w, state.fly.yaw) / terms.SPEED_UNIT


def progress(state: TaskState) -> FloatArray:
    """Decrease of the distance to the target, by its motion and the fly's, mm, (n,)."""
    place = state.props[:, 0]
    before = revolved(place, state.previous.time - state.fly.time, state.command)[:, :2]
    return terms.goal_distance(state.previous.position_w, before) - terms.goal_distance(
        state.fly.position_w, place[:, :2]
    )


@TaskFunction
def chase(
    distance: Annotated[tuple[float, float], Within(0, 1000)] = (5.0, 10.0),
    speed: Annotated[float, Within(0, 100)] = 8.0,
    radius: Annotated[float, Within(0.1, 1e4)] = 6.0,
    reach: Annotated[float, Within(1e-3, 1000)] = 1.0,
    time_limit: Annotated[float, TIME] = 4.0,
) -> Task:
    """Catch a target that moves along a circle.

    Parameters
    ----------
    distance
        Least and greatest distance of the target from the fly at the start, mm.
    speed
        Speed of the target, mm/s; a fly walks straight at up to 19.
    radius
        Radius of the circle, mm; 1000 is as good as a straight line.
    reach
        The target is caught within this horizontal distance of the thorax, mm.
    time_limit
        s until the episode is cut off.
    """
    near, far = beyond_reach("task.distance", distance, reach)
    caught = partial(terms.is_at_target, reach=reach, place=target)
    direction = partial(terms.target_direction_b, place=target)
    return steering(
        observation=(
            direction_term(direction, "the target's bearing from the heading"),
            distance_term(partial(terms.target_distance, place=target), "the target"),
            ObservationTerm(
                "target_velocity", (2,), -5.0, 5.0, target_velocity_b,
                "forward and leftward velocity of the target, in 20 mm/s",
            ),
        ),
        reward=(
            RewardTerm("progress", 0.2, progress, "mm closer to the target"),
            *terms.success_in_time(caught, "the target is caught"),
        ),
        solved=caught,
        time_limit_s=time_limit,
        props=(Prop("target", "marker", (reach,), (0.85, 0.2, 0.2, 0.6), path=revolved),),
        sample_episode=partial(
            sample_episode, distance=distance, speed=speed, radius=radius, time_limit=time_limit
        ),
        difficulty=f"distance of the target, from {near:g} mm to {near:g}-{far:g}, its bearing, "
        f"from 0 to ±180°, and its speed, from 0 to {speed:g} mm/s",
        success=f"thorax within {reach:g} mm of the target",
        errors=(
            terms.error("heading_error_deg", 180.0, partial(terms.turn_to_target, place=target)),
        ),
    )  # fmt: skip
