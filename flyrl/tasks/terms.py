"""Terms that tasks are made of: pure functions from a `TaskState` to arrays.

The first axis of every result is the simulation. What ends in `_b` is in the fly's own frame:
x forward along the heading's horizontal direction, y to the left.
"""

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks.task import Array, Mask, TaskState

FALL_TILT = np.deg2rad(75.0)
"""rad; a thorax tilted further than this from level has fallen over."""

_COS_FALL_TILT = float(np.cos(FALL_TILT))

ARENA_FLOOR = -5.0
"""mm; below this a fly has dropped off the terrain."""

REACH = 1.0
"""mm; a target is reached when the thorax is within this horizontal distance."""

CONTACT_THRESHOLD = 1.0
"""µN; a leg touches the ground when the ground pushes it harder than this (as in stumbling)."""

CORRECTION_CAP = 80.0
"""Correction amount at which the reflexes are capped."""


def _to_yaw_frame(vector_w: Array, yaw: NDArray[np.float64]) -> Array:
    """Rotate horizontal vectors (n, 2) from the world into the fly's yaw frame."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = vector_w[:, 0], vector_w[:, 1]
    vector_b = np.empty((len(yaw), 2))
    vector_b[:, 0] = cos * x + sin * y
    vector_b[:, 1] = cos * y - sin * x
    return vector_b


def goal_distance(position_w: Array, goal: Array) -> Array:
    """Horizontal distance from the thorax to the target, mm, (n,)."""
    offset = goal - position_w[:, :2]
    return np.asarray(np.hypot(offset[:, 0], offset[:, 1]))


# --- observations --------------------------------------------------------------------------


def target_direction_b(state: TaskState) -> Array:
    """Unit vector to the target: (cos, sin) of its bearing, left positive, (n, 2)."""
    offset_w = state.goal - state.fly.position_w[:, :2]
    offset_b = _to_yaw_frame(offset_w, state.fly.yaw)
    length = np.linalg.norm(offset_b, axis=1, keepdims=True)
    return np.asarray(offset_b / np.maximum(length, 1e-9))


def target_distance(state: TaskState) -> Array:
    """Distance to the target in units of 15 mm, (n, 1)."""
    return goal_distance(state.fly.position_w, state.goal)[:, None] / 15.0


def velocity_b(state: TaskState) -> Array:
    """Forward and leftward velocity in units of 20 mm/s, (n, 2)."""
    return _to_yaw_frame(state.fly.velocity_w[:, :2], state.fly.yaw) / 20.0


def heading_rate(state: TaskState) -> Array:
    """Yaw rate in units of 10 rad/s, left positive, (n, 1)."""
    return state.fly.angular_velocity_w[:, 2:] / 10.0


def tilt_b(state: TaskState) -> Array:
    """Horizontal components of the world's up direction in the thorax frame, (n, 2)."""
    return state.fly.up_b[:, :2]


def drive(state: TaskState) -> Array:
    """Current drive (left, right), (n, 2)."""
    return state.fly.drive


def phase_vectors(state: TaskState) -> Array:
    """Cosines, then sines, of the six legs' phases, (n, 12)."""
    return np.concatenate([np.cos(state.fly.phases), np.sin(state.fly.phases)], axis=1)


def magnitudes(state: TaskState) -> Array:
    """Magnitudes of the six oscillators, (n, 6)."""
    return state.fly.magnitudes


def leg_contacts(state: TaskState) -> Array:
    """1 for each leg that touches the ground, (n, 6)."""
    forces_w = state.fly.contact_forces_w.reshape(-1, 6, 6, 3).sum(axis=2)
    return np.asarray(np.linalg.norm(forces_w, axis=2) > CONTACT_THRESHOLD, dtype=np.float64)


def reflexes(state: TaskState) -> Array:
    """Correction amounts over their cap: six of retraction, six of stumbling, (n, 12)."""
    return np.concatenate([state.fly.retraction, state.fly.stumbling], axis=1) / CORRECTION_CAP


def joints(state: TaskState) -> Array:
    """Angles (rad), velocities (rad/s) and actuator torques (µN·mm), (n, 3, 42)."""
    fly = state.fly
    table = np.empty((len(fly.time), 3, 42))
    table[:, 0] = fly.joint_angles
    table[:, 1] = fly.joint_velocities
    table[:, 2] = fly.actuator_torques
    return table


def thorax(state: TaskState) -> Array:
    """Position (mm), velocity (mm/s), yaw-pitch-roll (rad), their rates (rad/s), (n, 4, 3).

    Yaw-pitch-roll are the intrinsic z-y-x angles of the thorax.
    """
    fly = state.fly
    rotation_w = fly.rotation_w
    sin_pitch = np.minimum(np.maximum(-rotation_w[:, 2, 0], -1.0), 1.0)
    cos_pitch = np.maximum(np.sqrt(1.0 - sin_pitch**2), 1e-6)
    yaw = fly.yaw
    # rates of the angles from the angular velocity in the frame after yaw
    spin = _to_yaw_frame(fly.angular_velocity_w[:, :2], yaw)
    roll_rate = spin[:, 0] / cos_pitch
    table = np.empty((len(yaw), 4, 3))
    table[:, 0] = fly.position_w
    table[:, 1] = fly.velocity_w
    table[:, 2, 0] = yaw
    table[:, 2, 1] = np.arcsin(sin_pitch)
    table[:, 2, 2] = np.arctan2(rotation_w[:, 2, 1], rotation_w[:, 2, 2])
    table[:, 3, 0] = fly.angular_velocity_w[:, 2] + sin_pitch * roll_rate
    table[:, 3, 1] = spin[:, 1]
    table[:, 3, 2] = roll_rate
    return table


def contact_forces(state: TaskState) -> Array:
    """Ground's force on each sensed segment, µN, world frame, (n, 36, 3)."""
    return state.fly.contact_forces_w


def end_effectors(state: TaskState) -> Array:
    """Tarsus5 of each leg, mm, world frame, (n, 6, 3)."""
    return state.fly.end_effectors_w


def heading(state: TaskState) -> Array:
    """Unit vector along the thorax, world frame, (n, 3)."""
    return state.fly.heading_w


# --- rewards -------------------------------------------------------------------------------


def progress(state: TaskState) -> Array:
    """By how much the distance to the target shrank, mm, (n,)."""
    return goal_distance(state.previous.position_w, state.goal) - goal_distance(
        state.fly.position_w, state.goal
    )


def forward_progress(state: TaskState) -> Array:
    """Displacement along +x, mm, (n,)."""
    return state.fly.position_w[:, 0] - state.previous.position_w[:, 0]


def elapsed(state: TaskState) -> Array:
    """Time since the last decision, s, (n,)."""
    return state.fly.time - state.previous.time


def reached(state: TaskState) -> Array:
    """1 where the target is reached, (n,)."""
    return is_at_target(state).astype(np.float64)


def lost_time(state: TaskState) -> Array:
    """Time left, s, where the fly fell, left the arena or blew up, else 0, (n,)."""
    is_lost = has_fallen(state) | has_left(state) | state.fly.is_unstable
    return np.where(is_lost, state.remaining_s, 0.0)


# --- terminations --------------------------------------------------------------------------


def is_at_target(state: TaskState) -> Mask:
    """Whether the thorax is within REACH of the target, (n,)."""
    return np.asarray(goal_distance(state.fly.position_w, state.goal) < REACH)


def has_fallen(state: TaskState) -> Mask:
    """Whether the thorax is tilted further than FALL_TILT, (n,)."""
    return np.asarray(state.fly.up_b[:, 2] < _COS_FALL_TILT)


def has_left(state: TaskState) -> Mask:
    """Whether the thorax is outside the terrain or below it, (n,)."""
    x, y, z = state.fly.position_w.T
    bounds = state.bounds
    is_inside = (
        (x >= bounds.x_min) & (x <= bounds.x_max) & (y >= bounds.y_min) & (y <= bounds.y_max)
    )
    return np.asarray(~is_inside | (z < ARENA_FLOOR))
