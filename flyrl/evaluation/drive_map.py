"""What each descending drive makes of a fly: its speed and yaw rate over the 2-D drive plane."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import FIRST_SEED, EvaluationConfig
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW
from flyrl.terrains import TerrainConfig

FloatArray = NDArray[np.float64]

SETTLE_S: Final = 0.25
"""Until the gait has settled, s: three strides."""

MEASURE_S: Final = 0.5
"""For which speed and yaw rate are measured, s: six strides."""


@dataclass(frozen=True, eq=False)
class DriveMap:
    """Speed and yaw rate by drive.

    Attributes
    ----------
    drives
        Values of the drive, the same for both sides, shape (k,).
    speed_mm_s
        Way from start to end of the measurement ÷ time, shape (k, k): row left, column right.
    yaw_rate_deg_s
        Turn ÷ time, left positive, shape (k, k).
    """

    drives: FloatArray
    speed_mm_s: FloatArray
    yaw_rate_deg_s: FloatArray


def measure_drive_map(config: EvaluationConfig, terrain: TerrainConfig, size: int = 9) -> DriveMap:
    """Let flies walk at constant drives, from the same start, on the hybrid controller.

    A fly that falls, leaves the arena or diverges has no speed and yaw rate there: NaN.

    Parameters
    ----------
    config
        Body, physics and task, whose time limit does not count.
    terrain
        Where.
    size
        Values of the drive on each side.
    """
    drives = np.linspace(DRIVE_LOW, DRIVE_HIGH, size)
    left, right = (side.ravel() for side in np.meshgrid(drives, drives, indexing="ij"))
    task = dataclasses.replace(config.resolved_task, time_limit_s=None)
    env = BatchedEnv(
        dataclasses.replace(config.env(terrain), task=task, log_gait=False),
        left.size,
        config.num_threads,
    )
    # long before any episode that is compared on
    start = env.config.sample_episode(FIRST_SEED - 1)
    env.reset(episodes=[start] * left.size)
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
    speed = np.where(has_failed, np.nan, way / duration)
    yaw_rate = np.where(has_failed, np.nan, np.rad2deg(turned) / duration)
    return DriveMap(drives, speed.reshape(size, size), yaw_rate.reshape(size, size))
