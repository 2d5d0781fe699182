"""Velocity: walk at a commanded forward speed and yaw rate, which change every second, for 4 s.

Speed and yaw rate sway with every stride, so they are judged by their running means over about one
(`STRIDE_S`), which the fly is shown. A success is to be on command for 3 of the 4 s: with both
means within 2 mm/s and 1 rad/s of what is commanded. The rest is for getting there after a change.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from flyrl.tasks import hybrid_turning, terms
from flyrl.tasks.actions import Drives
from flyrl.tasks.episode import Episode
from flyrl.tasks.failures import FAILURES
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import ErrorTerm, Mask, MeanTerm, ObservationTerm, RewardTerm, Task, TaskState
from flyrl.terrains import Terrain

NUM_COMMANDS: Final = 4

SPEEDS: Final = (2.0, 12.0)
"""mm/s; at the drive (1, 1) a fly walks straight at 13. None is so slow that standing would do."""

YAW_RATES: Final = (-2.5, 2.5)
"""rad/s; at the drive (1.25, 0.25) a fly turns at 3."""

ON_COMMAND_S: Final = 3.0
"""s on command that make a success."""


def sample_episode(terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
    """Draw a spawn, the commands (uniform), and the CPG's start.

    With the difficulty, the ranges of the commands grow from their middle.
    """
    rng = np.random.default_rng([seed, 1])
    lowest, highest = np.array([SPEEDS, YAW_RATES]).T
    middle, reach = (lowest + highest) / 2, difficulty * (highest - lowest) / 2
    low, high = middle - reach, middle + reach
    commands = rng.uniform(low, high, size=(NUM_COMMANDS, 2))
    command = tuple(float(value) for value in commands.ravel())
    return replace(hybrid_turning.sample_episode(terrain, seed, difficulty), command=command)


def was_on_command(state: TaskState) -> Mask:
    """Whether the fly was on command for ON_COMMAND_S, (n,)."""
    # but for rounding: the total is a sum of decisions
    return state.totals["on_command"] >= ON_COMMAND_S - 1e-6


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
        ObservationTerm(
            "mean_velocity", (2,), -5.0, 5.0, terms.mean_velocity,
            "mean forward speed, in 20 mm/s, and yaw rate, in 10 rad/s, over about a stride",
            spread=0.15,
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("tracking", 1.0, terms.time_tracked, "s times how well the command is followed"),
        RewardTerm("on_command", 1.0, terms.time_on_command, "s within 2 mm/s and 1 rad/s of it"),
    ),
    terminations=FAILURES,
    time_limit_s=NUM_COMMANDS * terms.COMMAND_S,
    decision_interval_s=0.02,
    actions=Drives(),
    sample_episode=sample_episode,
    difficulty="range of the commands, from 7 mm/s to 2-12, and from 0 to ±2.5 rad/s",
    succeeds_in_time=was_on_command,
    means=(
        MeanTerm(
            "velocity", 2, terms.STRIDE_S, terms.velocity_over_decision,
            "forward speed, mm/s, and yaw rate, rad/s",
        ),
    ),
    success=f"within {terms.TOLERATED_SPEED:g} mm/s and {terms.TOLERATED_YAW_RATE:g} rad/s of the "
    f"command for {ON_COMMAND_S:g} s",
    errors=(
        ErrorTerm("speed_error_mm_s", SPEEDS[1], terms.off_speed),
        ErrorTerm("yaw_rate_error_deg_s", float(np.rad2deg(YAW_RATES[1])), terms.off_yaw_rate),
    ),
)  # fmt: skip
