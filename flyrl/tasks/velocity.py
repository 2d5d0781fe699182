"""Velocity: walk at a commanded forward speed and yaw rate, which change every now and then.

Speed and yaw rate sway with every stride, so they are judged by their running means over about one
(`STRIDE_S`), which the fly is shown. A success is to be on command for most of the time: with both
means within a tolerance of what is commanded. The rest is for getting there after a change.
"""

import math
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, Final

import numpy as np

from flyrl.tasks import terms
from flyrl.tasks.episode import EDGE_MARGIN, TIME, Episode, is_inside
from flyrl.tasks.function import TaskFunction
from flyrl.tasks.hybrid_turning import sample_episode as bare_episode
from flyrl.tasks.senses import steering
from flyrl.tasks.task import MeanTerm, ObservationTerm, RewardTerm, Task
from flyrl.tasks.terms import Pair
from flyrl.terrains import Terrain
from flyrl.validation import FloatArray, Within, ordered

REDRAWS: Final = 100
"""Attempts to draw commands that stay on the terrain; the easiest ones all lead straight ahead."""

WAY_STEP_S: Final = 0.1


def sample_episode(
    terrain: Terrain,
    seed: int,
    difficulty: float = 1.0,
    *,
    speed: Pair,
    yaw_rate: Pair,
    commands: int,
    command_time: float,
) -> Episode:
    """Draw a spawn, a number of commands (uniform), and the CPG's start.

    With the difficulty, the ranges of the commands, mm/s and rad/s, grow from their middle. Where
    they would lead off the terrain they are drawn again, `REDRAWS` times at most.
    """
    episode = bare_episode(terrain, seed, difficulty)
    rng = np.random.default_rng([seed, 1])
    lowest, highest = np.array([speed, yaw_rate]).T
    middle, reach = (lowest + highest) / 2, difficulty * (highest - lowest) / 2
    low, high = middle - reach, middle + reach
    for _ in range(REDRAWS):
        drawn = rng.uniform(low, high, size=(commands, 2))
        x, y = commanded_way(episode, drawn, command_time)
        if is_inside(x, y, terrain.bounds, EDGE_MARGIN).all():
            break
    return replace(episode, command=tuple(drawn.ravel().tolist()))


def commanded_way(episode: Episode, commands: FloatArray, command_time: float) -> FloatArray:
    """Places x and y, mm, to which commands lead, every `WAY_STEP_S`, (2, places).

    Parameters
    ----------
    episode
        Episode, for the fly's start.
    commands
        Forward speeds, mm/s, and yaw rates, rad/s, (k, 2), each for `command_time`, s.
    """
    steps = math.ceil(command_time / WAY_STEP_S)
    forward, turn = np.repeat(commands, steps, axis=0).T * command_time / steps
    yaw = episode.spawn_yaw + np.cumsum(turn) - turn / 2
    x, y = episode.spawn_position_w[:2]
    return np.array([x + np.cumsum(forward * np.cos(yaw)), y + np.cumsum(forward * np.sin(yaw))])


@TaskFunction
def velocity(
    speed: Annotated[Pair, Within(-20, 20)] = (2.0, 12.0),
    yaw_rate: Annotated[Pair, Within(-10, 10)] = (-2.5, 2.5),
    command_time: Annotated[float, TIME] = 1.0,
    tolerance: Annotated[Pair, Within(1e-3, 100)] = (2.0, 1.0),
    on_command: Annotated[float, TIME] = 3.0,
    time_limit: Annotated[float, TIME] = 4.0,
) -> Task:
    """Follow commands of speed and yaw rate.

    Parameters
    ----------
    speed
        Least and greatest forward speed that is commanded, mm/s. At the drive (1, 1) a fly walks
        straight at 13; by default none is so slow that standing would do.
    yaw_rate
        Least and greatest yaw rate, rad/s, left positive; at the drive (1.25, 0.25) a fly turns at
        3.
    command_time
        Time for which a command holds before the next one, s.
    tolerance
        A fly is on command when its mean speed and yaw rate over a stride are within these of it,
        mm/s and rad/s.
    on_command
        s on command, in all, that make a success.
    time_limit
        s until the episode is cut off.
    """
    slowest, fastest = ordered("task.speed", speed)
    right, left = ordered("task.yaw_rate", yaw_rate)
    judged: dict[str, Any] = {"command_s": command_time, "tolerance": tolerance}
    turn = f"±{left:g}" if right == -left else f"{right:g} to {left:g}"
    middle = (right + left) / 2
    return steering(
        observation=(
            ObservationTerm(
                "command", (2,), -1.0, 1.0,
                partial(terms.commanded_velocity, command_s=command_time),
                "commanded forward speed, in 20 mm/s, and yaw rate, in 10 rad/s",
            ),
            ObservationTerm(
                "command_time", (1,), 0.0, command_time,
                partial(terms.command_time_left, command_s=command_time),
                "s until the next command",
            ),
            ObservationTerm(
                "mean_velocity", (2,), -5.0, 5.0, terms.mean_velocity,
                "mean forward speed, in 20 mm/s, and yaw rate, in 10 rad/s, over about a stride",
                spread=0.15,
            ),
        ),
        reward=(
            RewardTerm(
                "tracking", 1.0, partial(terms.time_tracked, **judged),
                "s times how well the command is followed",
            ),
            RewardTerm(
                "on_command", 1.0, partial(terms.time_on_command, **judged),
                f"s within {tolerance[0]:g} mm/s and {tolerance[1]:g} rad/s of it",
            ),
        ),
        time_limit_s=time_limit,
        extent_mm=max(map(abs, speed)) * time_limit,
        sample_episode=partial(
            sample_episode, speed=speed, yaw_rate=yaw_rate,
            commands=math.ceil(time_limit / command_time - 1e-9), command_time=command_time,
        ),
        difficulty=f"range of the commands, from {(slowest + fastest) / 2:g} mm/s to "
        f"{slowest:g}-{fastest:g}, and from {middle:g} to {turn} rad/s",
        succeeds_in_time=partial(terms.lasted, reward="on_command", seconds=on_command),
        means=(
            MeanTerm(
                "velocity", 2, terms.STRIDE_S, terms.velocity_over_decision,
                "forward speed, mm/s, and yaw rate, rad/s",
            ),
        ),
        success=f"within {tolerance[0]:g} mm/s and {tolerance[1]:g} rad/s of the command for "
        f"{on_command:g} s",
        errors=(
            terms.error("speed_error_mm_s", _largest(speed), partial(terms.off_speed, **judged)),
            terms.error(
                "yaw_rate_error_deg_s", float(np.rad2deg(_largest(yaw_rate))),
                partial(terms.off_yaw_rate, **judged),
            ),
        ),
        decisive=("success", "speed_error_mm_s"),
        # to keep up what is asked takes as long as the episode, and is no question of speed
        compared=("speed_error_mm_s", "yaw_rate_error_deg_s"),
    )  # fmt: skip


def _largest(pair: Pair) -> float:
    """Largest size in a range; of a fly that stands it is the error. Above 0, so that it counts."""
    return max(abs(pair[0]), abs(pair[1])) or 1.0
