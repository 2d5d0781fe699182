"""Drives: speed and yaw rate over the 2-D drive plane, and drives of policies by bearing."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import FIRST_SEED, EvaluationConfig
from flyrl.evaluation.entrants import Entrant
from flyrl.rollouts import BoolArray
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW, Drives
from flyrl.terrains import Terrain
from flyrl.validation import FloatArray, at_least

SETTLE_S: Final = 0.25
"""Until the gait has settled, s: three strides."""

MEASURE_S: Final = 0.5
"""For which speed and yaw rate are measured, s: six strides."""


@dataclass(frozen=True, eq=False)
class DriveMap:
    """Speed and yaw rate by drive.

    Attributes
    ----------
    terrain
        Where.
    drives
        Values of the drive, the same for both sides, shape (k,).
    speed_mm_s
        Way from start to end of the measurement ÷ time, shape (k, k): row left, column right.
    yaw_rate_deg_s
        Turn ÷ time, left positive, shape (k, k).
    starts
        Flies per drive, each from a start of its own; both arrays are their means.
    speed_error_mm_s, yaw_rate_error_deg_s
        Standard errors of the means, shape (k, k).
    """

    terrain: str
    drives: FloatArray
    speed_mm_s: FloatArray
    yaw_rate_deg_s: FloatArray
    starts: int
    speed_error_mm_s: FloatArray
    yaw_rate_error_deg_s: FloatArray


def measure_drive_map(
    config: EvaluationConfig, terrain: Terrain, size: int = 5, starts: int = 8
) -> DriveMap:
    """Let flies walk at constant drives, from the same starts, on the hybrid controller.

    Flies that fall, leave the arena or diverge are left out; NaN where half of them do.

    Parameters
    ----------
    config
        Body, physics and task, whose time limit does not count.
    terrain
        Where.
    size
        Values of the drive on each side.
    starts
        Flies per drive, at least 2.
    """
    at_least("starts", starts, 2)
    drives = np.linspace(DRIVE_LOW, DRIVE_HIGH, size)
    pairs = np.stack(np.meshgrid(drives, drives, indexing="ij"), axis=-1).reshape(-1, 2)
    left, right = np.repeat(pairs, starts, axis=0).T
    task = dataclasses.replace(config.resolved_task, time_limit_s=None)
    env = BatchedEnv(
        dataclasses.replace(config.env(terrain), task=task, log_gait=False),
        left.size,
        config.num_threads,
    )
    # long before any episode that is compared on
    episodes = [env.config.sample_episode(FIRST_SEED - 1 - i) for i in range(starts)]
    env.reset(episodes=episodes * len(pairs))
    action = task.actions.of(np.stack([left, right], axis=1)).astype(np.float32)
    interval = env.config.decision_interval_s
    has_failed = np.zeros(left.size, dtype=bool)
    turned = np.zeros(left.size)
    begin = env.state
    settle, end = round(SETTLE_S / interval), round((SETTLE_S + MEASURE_S) / interval)
    for decision in range(1, end + 1):
        before = env.state.yaw
        transition = env.step(action)
        has_failed |= transition.terminated & ~transition.is_success
        if decision == settle:
            begin = env.state
        elif decision > settle:
            turned += (env.state.yaw - before + np.pi) % (2 * np.pi) - np.pi
    duration = (end - settle) * interval
    way = np.linalg.norm((env.state.position_w - begin.position_w)[:, :2], axis=1)
    has_walked = ~has_failed.reshape(size, size, starts)
    (speed, speed_error), (yaw_rate, yaw_rate_error) = (
        mean_and_error(values.reshape(has_walked.shape) / duration, has_walked)
        for values in (way, np.rad2deg(turned))
    )
    return DriveMap(terrain.label, drives, speed, yaw_rate, starts, speed_error, yaw_rate_error)


def mean_and_error(values: FloatArray, has_walked: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean over the starts and its standard error; NaN where at least half of the flies failed.

    Parameters
    ----------
    values, has_walked
        Of each fly, starts along the last axis.
    """
    count = has_walked.sum(axis=-1)
    is_known = 2 * count > values.shape[-1]
    mean = np.sum(values, axis=-1, where=has_walked) / np.where(is_known, count, np.nan)
    square = np.sum((values - mean[..., np.newaxis]) ** 2, axis=-1, where=has_walked)
    # more than half of two are two, so that known means have at least two
    return mean, np.sqrt(square / np.where(is_known, count - 1, np.nan) / count)


BEARINGS_DEG: Final = tuple(range(-180, 181, 5))

STARTS: Final = 16
"""Episodes at most whose starts are shown to a policy."""


@dataclass(frozen=True, eq=False)
class Steering:
    """Drives over bearings.

    Attributes
    ----------
    bearings_deg
        Left positive, shape (k,).
    drives
        Left and right drive by entrant, shape (starts, k, 2).
    """

    bearings_deg: FloatArray
    drives: Mapping[str, FloatArray]


def measure_steering(
    config: EvaluationConfig, entrants: Sequence[Entrant], terrain: Terrain
) -> Steering | None:
    """Show each policy every bearing at the starts of episodes; note the drives it answers with.

    All other senses are those of the start. Asked are learned policies and fixed ones that see the
    bearing; None where there is none of them, or where the task shows no bearing.

    Parameters
    ----------
    config
        Of the evaluation.
    entrants
        Of the evaluation.
    terrain
        Where the episodes start.
    """
    task = config.resolved_task
    shown = next((term.name for term in task.observation if term.is_bearing), None)
    if shown is None or not task.is_flat or not isinstance(task.actions, Drives):
        return None
    asked = [
        each
        for each in entrants
        if each.record["kind"] == "learned" or shown in each.record.get("sees", ())
    ]
    if not asked:
        return None
    episodes = config.draw_episodes(terrain)[:STARTS]
    env = BatchedEnv(config.env(terrain), len(episodes), config.num_threads)
    starts = env.reset(episodes=episodes)
    assert not isinstance(starts, dict)  # the task is flat
    bearings = np.radians(BEARINGS_DEG)
    views = np.repeat(starts, len(bearings), axis=0)
    views[:, task.slices()[shown]] = np.tile(
        np.stack([np.cos(bearings), np.sin(bearings)], axis=1), (len(episodes), 1)
    )
    shape = (len(episodes), len(bearings), 2)
    return Steering(
        np.array(BEARINGS_DEG, dtype=np.float64),
        {
            each.name: task.actions.commands(each.policy.predict(views)[0]).reshape(shape)
            for each in asked
        },
    )
