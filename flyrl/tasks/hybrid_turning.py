"""HybridTurning and Joints: the bare decision problems of the literature.

An action is the descending drive, or every joint's target and every grip: the published base
environment (Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y).
"""

from dataclasses import replace
from operator import attrgetter
from typing import Annotated

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW, Drives, JointTargets
from flyrl.tasks.episode import TIME, Episode, draw_oscillators, draw_spawn
from flyrl.tasks.function import TaskFunction, variant_of
from flyrl.tasks.task import ObservationTerm, RewardTerm, Task, TaskState
from flyrl.tasks.terms import FAILURES, to_yaw_frame
from flyrl.terrains import Terrain
from flyrl.validation import FloatArray


def joint_states(state: TaskState) -> FloatArray:
    """Angles (rad), velocities (rad/s) and actuator torques (µN·mm), (n, 3, 42)."""
    fly = state.fly
    return np.stack([fly.joint_angles, fly.joint_velocities, fly.actuator_torques], axis=1)


def thorax(state: TaskState) -> FloatArray:
    """Position (mm), velocity (mm/s), yaw-pitch-roll (rad), their rates (rad/s), (n, 4, 3).

    Yaw-pitch-roll are the intrinsic z-y-x angles of the thorax.
    """
    fly = state.fly
    rotation_w = fly.rotation_w
    sin_pitch = np.minimum(np.maximum(-rotation_w[:, 2, 0], -1.0), 1.0)
    cos_pitch = np.maximum(np.sqrt(1.0 - sin_pitch**2), 1e-6)
    yaw = fly.yaw
    # rates of the angles from the angular velocity in the frame after yaw
    spin = to_yaw_frame(fly.angular_velocity_w[:, :2], yaw)
    roll_rate = spin[:, 0] / cos_pitch
    yaw_rate = fly.angular_velocity_w[:, 2] + sin_pitch * roll_rate
    roll = np.arctan2(rotation_w[:, 2, 1], rotation_w[:, 2, 2])
    angles = np.stack([yaw, np.arcsin(sin_pitch), roll], axis=1)
    rates = np.stack([yaw_rate, spin[:, 1], roll_rate], axis=1)
    return np.stack([fly.position_w, fly.velocity_w, angles, rates], axis=1)


def sample_episode(terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
    """Draw a spawn and the CPG's start."""
    spawn = draw_spawn(terrain, np.random.default_rng(seed))
    phases, magnitudes = draw_oscillators(seed)
    return Episode(seed, spawn, 0.0, (), phases, magnitudes, difficulty=difficulty)


@TaskFunction
def hybrid_turning(time_limit: Annotated[float | None, TIME] = None) -> Task:
    """Walk as you like, one physics step per decision; `time_limit`, s, may be None."""
    return Task(
        observation=(
            ObservationTerm(
                "joints", (3, 42), -5000.0, 5000.0, joint_states,
                "angles (rad), velocities (rad/s) and actuator torques (µN·mm) of the leg joints",
                spread=(0.13, 15.0, 2.0),
            ),
            ObservationTerm(
                "fly", (4, 3), -5000.0, 5000.0, thorax,
                "position (mm), velocity (mm/s), yaw-pitch-roll (rad) and their rates (rad/s)",
                # no fly senses where in the world it is, so that is as exact as the end effectors
                spread=(0.0, 10.0, 0.05, 6.0),
            ),
            ObservationTerm(
                "contact_forces", (36, 3), -1e6, 1e6, attrgetter("fly.contact_forces_w"),
                "ground's force on each sensed leg segment (µN, world frame)",
                spread=8.0,
            ),
            ObservationTerm(
                "end_effectors", (6, 3), -1000.0, 1000.0, attrgetter("fly.end_effectors_w"),
                "position of each leg's Tarsus5 (mm, world frame)",
            ),
            ObservationTerm(
                "fly_orientation", (3,), -1.0, 1.0, attrgetter("fly.heading_w"),
                "unit heading (world frame)",
                spread=0.05,
            ),
        ),
        is_flat=False,
        reward=(RewardTerm("forward", 1.0, terms.forward_progress, "mm along +x"),),
        terminations=FAILURES,
        time_limit_s=time_limit,
        decision_interval_s=None,
        actions=Drives(DRIVE_LOW, DRIVE_HIGH),
        sample_episode=sample_episode,
        decisive=("advance_mm",),
        compared=("advance_mm", "speed_mm_s"),
    )  # fmt: skip


@variant_of(hybrid_turning)
def joints(task: Task) -> Task:
    """Observe and reward as in `hybrid_turning`; an action is a dict."""
    return replace(task, actions=JointTargets())


@variant_of(hybrid_turning)
def joints_box(task: Task) -> Task:
    """The same with one vector as its action."""
    return replace(task, actions=JointTargets(is_dict=False))
