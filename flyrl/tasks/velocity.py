"""Velocity: walk at a commanded forward speed and yaw rate, which change every second."""

from dataclasses import replace
from typing import Final

import numpy as np

from flyrl.tasks import hybrid_turning, terms
from flyrl.tasks.episode import Episode
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import Mask, ObservationTerm, RewardTerm, Task, TaskState, Termination
from flyrl.terrains import TerrainConfig

NUM_COMMANDS: Final = 4

SPEEDS: Final = (2.0, 12.0)
"""mm/s; at the drive (1, 1) a fly walks straight at 13."""

YAW_RATES: Final = (-2.5, 2.5)
"""rad/s; at the drive (1.25, 0.25) a fly turns at 3."""

TRACKED_S: Final = 2.0
"""s of perfect tracking, or of less good tracking in proportion, that make a success."""


def sample_episode(terrain: TerrainConfig, seed: int) -> Episode:
    """Draw a spawn, the commands (uniform), and the CPG's start."""
    rng = np.random.default_rng([seed, 1])
    low, high = np.array([SPEEDS, YAW_RATES]).T
    commands = rng.uniform(low, high, size=(NUM_COMMANDS, 2))
    command = tuple(float(value) for value in commands.ravel())
    return replace(hybrid_turning.sample_episode(terrain, seed), command=command)


def was_tracked(state: TaskState) -> Mask:
    """Whether the commands were followed for TRACKED_S, (n,)."""
    return state.totals["tracking"] >= TRACKED_S


VELOCITY: Final = Task(
    name="velocity",
    observation=(
        ObservationTerm(
            "command", (2,), -1.0, 1.0, terms.commanded_velocity,
            "commanded forward speed, in 20 mm/s, and yaw rate, in 10 rad/s",
        ),
        ObservationTerm(
            "command_time", (1,), 0.0, 1.0, terms.command_time_left, "s until the next command"
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("tracking", 2.0, terms.time_tracked, "s times how well the command is followed"),
    ),
    terminations=(
        Termination("fall", terms.has_fallen),
        Termination("left_arena", terms.has_left),
    ),
    time_limit_s=NUM_COMMANDS * terms.COMMAND_S,
    decision_interval_s=0.02,
    action_low=-1.0,
    action_high=1.0,
    sample_episode=sample_episode,
    succeeds_in_time=was_tracked,
)  # fmt: skip
