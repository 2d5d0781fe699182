"""Terms that tasks are made of: pure functions from a `TaskState` to arrays.

The first axis of every result is the simulation. What ends in `_b` is in the fly's own frame:
x forward along the heading's horizontal direction, y to the left. Terms of a path or a
finish line are with their tasks.
"""

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks.episode import is_inside
from flyrl.tasks.task import (
    DECISIONS_LOST,
    FALL,
    IS_FAILURE,
    LEFT_ARENA,
    Compute,
    ErrorTerm,
    Mask,
    RewardTerm,
    TaskState,
    Termination,
)
from flyrl.validation import FloatArray

FALL_TILT = np.deg2rad(75.0)
"""rad; a thorax tilted further than this from level has fallen over."""

_COS_FALL_TILT = float(np.cos(FALL_TILT))


STRIDE_S = 1 / 12
"""s; period of the oscillators. Speed and yaw rate sway with it, by more than what is tolerated."""

Pair = tuple[float, float]

Place = Callable[[Any], FloatArray]
"""From a `TaskState` to horizontal places, mm, (n, 2)."""

GOAL: Final[Place] = attrgetter("goal")
"""The place that episodes lead to, of terms that are given no other."""

# units in which quantities are observed
DISTANCE_UNIT: Final = 15.0  # mm
TIME_UNIT: Final = 3.0  # s
SPEED_UNIT: Final = 20.0  # mm/s
YAW_RATE_UNIT: Final = 10.0  # rad/s

CORRECTION_CAP = 80.0
"""Correction amount at which the reflexes are capped."""


def to_yaw_frame(vector_w: FloatArray, yaw: NDArray[np.float64]) -> FloatArray:
    """Rotate horizontal vectors (n, 2) from the world into the body's yaw frame."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = vector_w[:, 0], vector_w[:, 1]
    vector_b = np.empty((len(yaw), 2))
    vector_b[:, 0] = cos * x + sin * y
    vector_b[:, 1] = cos * y - sin * x
    return vector_b


def direction_b(state: TaskState, place_w: FloatArray) -> FloatArray:
    """Unit vector to a place (n, 2), mm: (cos, sin) of its bearing, left positive, (n, 2)."""
    offset_b = to_yaw_frame(place_w - state.fly.position_w[:, :2], state.fly.yaw)
    # np.linalg.norm, with cold caches, takes half as long again
    length = np.sqrt((offset_b * offset_b).sum(axis=1, keepdims=True))
    return np.asarray(offset_b / np.maximum(length, 1e-9))


def goal_distance(position_w: FloatArray, goal: FloatArray) -> FloatArray:
    """Horizontal distance from the thorax to the target, mm, (n,)."""
    offset = goal - position_w[:, :2]
    return np.asarray(np.hypot(offset[:, 0], offset[:, 1]))


def _unit_vectors(angle: FloatArray) -> FloatArray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def heading_error(state: TaskState) -> FloatArray:
    """Angle from the fly's heading to the commanded one, left positive, rad, (n,)."""
    error = state.command[:, 0] - state.fly.yaw
    return np.asarray((error + np.pi) % (2 * np.pi) - np.pi)


def command_at(state: TaskState, time: FloatArray, command_s: float) -> FloatArray:
    """Commanded forward speed (mm/s) and yaw rate (rad/s) at a time since the reset, (n, 2).

    Each command holds for `command_s`, s, and the last one on.
    """
    commands = state.command.reshape(len(time), -1, 2)
    number = np.minimum(_command_number(time, command_s), commands.shape[1] - 1)
    chosen: FloatArray = commands[np.arange(len(time)), number]
    return chosen


def _command_number(time: FloatArray, command_s: float) -> NDArray[np.intp]:
    # a time that is a command's end but for rounding belongs to the next
    return np.floor(time / command_s + 1e-6).astype(np.intp)


def velocity_over_decision(state: TaskState) -> FloatArray:
    """Forward speed (mm/s) and yaw rate (rad/s), averaged over the last decision, (n, 2)."""
    turned = (state.fly.yaw - state.previous.yaw + np.pi) % (2 * np.pi) - np.pi
    duration = np.maximum(elapsed(state), 1e-9)
    return np.stack([forward_way(state), turned], axis=1) / duration[:, None]


def command_deviation(state: TaskState, command_s: float, tolerance: Pair) -> FloatArray:
    """Mean speed and yaw rate minus the command, in units of what is tolerated, (n, 2).

    `tolerance` is mm/s and rad/s.
    """
    deviation = state.means["velocity"] - command_at(state, state.previous.time, command_s)
    return deviation / tolerance


# --- observations --------------------------------------------------------------------------


def target_direction_b(state: TaskState, place: Place = GOAL) -> FloatArray:
    """Unit vector to the target: (cos, sin) of its bearing, left positive, (n, 2)."""
    return direction_b(state, place(state))


def target_distance(state: TaskState, place: Place = GOAL) -> FloatArray:
    """Distance to the target in units of 15 mm, (n, 1)."""
    return goal_distance(state.fly.position_w, place(state))[:, None] / DISTANCE_UNIT


def time_left(state: TaskState) -> FloatArray:
    """Time until the time limit in units of 3 s, 1 where there is more, (n, 1)."""
    return np.minimum(state.remaining_s / TIME_UNIT, 1.0)[:, None]


def commanded_direction_b(state: TaskState) -> FloatArray:
    """Unit vector along the commanded heading: (cos, sin) of the error, (n, 2)."""
    return _unit_vectors(heading_error(state))


def forward_direction_b(state: TaskState) -> FloatArray:
    """Unit vector along the world's x axis: (cos, sin) of its bearing, (n, 2)."""
    return _unit_vectors(-state.fly.yaw)


def commanded_velocity(state: TaskState, command_s: float) -> FloatArray:
    """Commanded forward speed in units of 20 mm/s, and yaw rate in units of 10 rad/s, (n, 2)."""
    return command_at(state, state.fly.time, command_s) / (SPEED_UNIT, YAW_RATE_UNIT)


def command_time_left(state: TaskState, command_s: float) -> FloatArray:
    """Time until the next command, s, (n, 1)."""
    time = state.fly.time
    return ((_command_number(time, command_s) + 1) * command_s - time)[:, None]


def mean_velocity(state: TaskState) -> FloatArray:
    """Mean of `velocity_over_decision`, in units of 20 mm/s and 10 rad/s, (n, 2)."""
    return state.means["velocity"] / (SPEED_UNIT, YAW_RATE_UNIT)


def velocity_b(state: TaskState) -> FloatArray:
    """Forward and leftward velocity in units of 20 mm/s, (n, 2)."""
    return to_yaw_frame(state.body.velocity_w[:, :2], state.body.yaw) / SPEED_UNIT


def heading_rate(state: TaskState) -> FloatArray:
    """Yaw rate in units of 10 rad/s, left positive, (n, 1)."""
    return state.fly.angular_velocity_w[:, 2:] / YAW_RATE_UNIT


def compass(state: TaskState) -> FloatArray:
    """Cosine and sine of the heading from +x, (n, 2)."""
    return _unit_vectors(state.body.yaw)


def tilt_b(state: TaskState) -> FloatArray:
    """Horizontal components of the world's up direction in the thorax frame, (n, 2)."""
    return state.fly.up_b[:, :2]


def phase_vectors(state: TaskState) -> FloatArray:
    """Cosines, then sines, of the six legs' phases, (n, 12)."""
    return np.concatenate([np.cos(state.fly.phases), np.sin(state.fly.phases)], axis=1)


def leg_contacts(state: TaskState) -> FloatArray:
    """1 for each leg that touches the ground, (n, 6)."""
    return state.fly.is_grounded


def reflexes(state: TaskState) -> FloatArray:
    """Correction amounts over their cap: six of retraction, six of stumbling, (n, 12)."""
    return np.concatenate([state.fly.retraction, state.fly.stumbling], axis=1) / CORRECTION_CAP


# --- errors --------------------------------------------------------------------------------

ERRORS: Final[dict[str, tuple[str, float]]] = {
    "heading_error_deg": ("angle between heading and where it should point, deg", 4.0),
    "path_error_mm": ("distance to the path, mm", 0.25),
    "speed_error_mm_s": ("difference from the commanded forward speed, mm/s", 0.5),
    "yaw_rate_error_deg_s": ("difference from the commanded yaw rate, deg/s", 15.0),
    "bend_error_deg": ("difference from the commanded bend of a worm, deg", 1.5),
    "recruited_share": ("share of a worm's motor neurons that are recruited", 0.05),
}
"""Description and smallest effect of interest by name.

The effects are about a quarter of what the tasks tolerate in a success, of a share 0.05.
"""


def error(name: str, worst: float, compute: Compute) -> ErrorTerm:
    """Error term of a name in `ERRORS`."""
    return ErrorTerm(name, worst, compute, *ERRORS[name])


def turn_to_target(state: TaskState, place: Place = GOAL) -> FloatArray:
    """Angle between the heading and the bearing of the target, deg, (n,)."""
    forward, left = target_direction_b(state, place).T
    return np.asarray(np.abs(np.rad2deg(np.arctan2(left, forward))))


def turn_to_heading(state: TaskState) -> FloatArray:
    """Angle between the heading and the commanded one, deg, (n,)."""
    return np.asarray(np.abs(np.rad2deg(heading_error(state))))


def off_speed(state: TaskState, command_s: float, tolerance: Pair) -> FloatArray:
    """Mean forward speed from the commanded one, mm/s, (n,)."""
    return np.abs(command_deviation(state, command_s, tolerance)[:, 0]) * tolerance[0]


def off_yaw_rate(state: TaskState, command_s: float, tolerance: Pair) -> FloatArray:
    """Mean yaw rate from the commanded one, deg/s, (n,)."""
    return np.rad2deg(np.abs(command_deviation(state, command_s, tolerance)[:, 1]) * tolerance[1])


# --- rewards -------------------------------------------------------------------------------


def progress(state: TaskState, place: Place = GOAL) -> FloatArray:
    """Decrease of the distance to the target, mm, (n,)."""
    target = place(state)
    before = goal_distance(state.previous.position_w, target)
    return np.asarray(before - goal_distance(state.fly.position_w, target))


def forward_progress(state: TaskState) -> FloatArray:
    """Displacement along +x, mm, (n,)."""
    return state.body.position_w[:, 0] - state.previous.position_w[:, 0]


def forward_way(state: TaskState) -> FloatArray:
    """Displacement along the heading before it, mm, (n,)."""
    way_w = (state.fly.position_w - state.previous.position_w)[:, :2]
    return np.asarray(to_yaw_frame(way_w, state.previous.yaw)[:, 0])


def elapsed(state: TaskState) -> FloatArray:
    """Time since the last decision, s, (n,)."""
    return state.fly.time - state.previous.time


def time_along_heading(state: TaskState) -> FloatArray:
    """Time since the last decision, times the cosine of the heading's error, s, (n,)."""
    return elapsed(state) * np.cos(heading_error(state))


def time_on_heading(state: TaskState, tolerance: float) -> FloatArray:
    """Time since the last decision where the heading is within a tolerance, rad, s, (n,)."""
    return np.where(np.abs(heading_error(state)) < tolerance, elapsed(state), 0.0)


def time_tracked(state: TaskState, command_s: float, tolerance: Pair) -> FloatArray:
    """Time since the last decision, times how well the command was followed (0 to 1), s, (n,).

    exp(-(d / 2)²) of both deviations d from the command; see `command_deviation`.
    """
    deviation = command_deviation(state, command_s, tolerance) / 2
    return np.asarray(elapsed(state) * np.exp(-(deviation**2).sum(axis=1)))


def time_on_command(state: TaskState, command_s: float, tolerance: Pair) -> FloatArray:
    """Time since the last decision where both means are as commanded, else 0, s, (n,)."""
    is_on = (np.abs(command_deviation(state, command_s, tolerance)) < 1.0).all(axis=1)
    return np.where(is_on, elapsed(state), 0.0)


def drive_change(state: TaskState) -> FloatArray:
    """Change of the drive with this decision, summed over both sides, (n,)."""
    change: FloatArray = np.abs(state.body.actuation - state.previous.actuation).sum(axis=1)
    return change


def joint_work(state: TaskState) -> FloatArray:
    """Positive work of the 42 joints' servos in a decision, by torques and velocities at its end.

    nJ (µN·mm), (n,).
    """
    power = state.fly.actuator_torques * state.fly.joint_velocities
    return np.asarray(np.maximum(power, 0.0).sum(axis=1) * elapsed(state))


# --- terminations --------------------------------------------------------------------------


def is_at_target(state: TaskState, reach: float, place: Place = GOAL) -> Mask:
    """Whether the thorax is within `reach` of the target, mm, horizontally, (n,)."""
    return goal_distance(state.fly.position_w, place(state)) < reach


def lasted(state: TaskState, reward: str, seconds: float) -> Mask:
    """Whether a reward of s has added up to so many in this episode, (n,)."""
    # but for rounding: the total is a sum of decisions
    return state.totals[reward] >= seconds - 1e-6


def has_fallen(state: TaskState) -> Mask:
    """Whether the thorax is tilted further than FALL_TILT, or has come off the ground, (n,)."""
    is_off = state.fly.position_w[:, 2] > state.bounds.z_max
    return np.asarray((state.fly.up_b[:, 2] < _COS_FALL_TILT) | is_off)


def has_left(state: TaskState) -> Mask:
    """Whether the thorax is outside the terrain or below it, (n,)."""
    x, y, z = state.fly.position_w.T
    return np.asarray(~is_inside(x, y, state.bounds) | (z < state.bounds.z_min))


# --- rows that tables share ----------------------------------------------------------------

DRIVE_TIME_CONSTANT_S: Final = 0.05
"""Time constant of the drive in steering tasks, s. A descending neuron is no switch: in hoverflies
its response to an impulse peaks after 17 ms and returns slowly (J. Exp. Biol. 224, 2021, doi
10.1242/jeb.242833)."""

SMOOTHNESS: Final = (
    RewardTerm("drive_change", -0.03, drive_change, "change of the drive, summed over both sides"),
    RewardTerm("work", 0.0, joint_work, "nJ that the joints do, as sampled at decisions"),
)
"""Rows of a reward table. Work counts nothing until a task, or task.weights, gives it a weight."""

FAILURES: Final = (Termination(FALL, has_fallen), Termination(LEFT_ARENA, has_left))


def has_failed(state: TaskState, failures: tuple[Termination, ...] = FAILURES) -> Mask:
    """Whether the fly failed or its physics blew up, (n,)."""
    is_failure = state.fly.is_unstable.copy()
    for failure in failures:
        is_failure |= state.once(failure.holds)
    return is_failure


def decisions_lost(state: TaskState) -> FloatArray:
    """Decisions left where the fly failed, else 0, (n,)."""
    return np.where(has_failed(state), state.decisions_left, 0.0)


def time_lost(state: TaskState, failures: tuple[Termination, ...] = FAILURES) -> FloatArray:
    """Time left, s, where the fly failed, else 0, (n,)."""
    return np.where(has_failed(state, failures), state.remaining_s, 0.0)


def failure_info(state: TaskState) -> dict[str, FloatArray | Mask]:
    """Facts of a decision that replay with other goals needs, (n,) by key."""
    return {IS_FAILURE: has_failed(state), DECISIONS_LOST: decisions_lost(state)}


def lost_time(weight: float, failures: tuple[Termination, ...] = FAILURES) -> RewardTerm:
    """Row of a reward table: a failure costs what the time that it cuts off could have cost."""
    lost = partial(time_lost, failures=failures)
    return RewardTerm("lost_time", weight, lost, "s left when the fly fails")


def success_in_time(
    holds: Callable[[Any], Mask],
    description: str,
    failures: tuple[Termination, ...] = FAILURES,
) -> tuple[RewardTerm, ...]:
    """Rows of a reward table: a bonus for success, and a cost of time, of which no failure saves.

    `holds` says where the task is solved, (n,).
    """
    return RewardTerm("success", 2.0, holds, description), *cost_of_time(failures)


def cost_of_time(failures: tuple[Termination, ...] = FAILURES) -> tuple[RewardTerm, ...]:
    """Rows of a reward table: time costs, and no failure saves the time that it cuts off."""
    return RewardTerm("time", -0.5, elapsed, "s gone by"), lost_time(-0.5, failures)
