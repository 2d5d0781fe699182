"""Yaw rate over a grid of drives, to tell whether a preset turns as another does."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PhysicsConfig
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW

Array = NDArray[np.float64]

SAMPLING_S = 0.01
SETTLING_S = 0.3
"""s from the start that do not count: the fly drops and the oscillators get going."""


def drives(size: int) -> Array:
    """Levels of drive of one side, over the whole range."""
    return np.linspace(DRIVE_LOW, DRIVE_HIGH, size)


def yaw_rates(
    physics: str | PhysicsConfig,
    size: int,
    conditions: int,
    seconds: float,
    threads: int = 0,
    first_seed: int = 0,
) -> tuple[Array, Array]:
    """Turn on flat ground under every pair of drives.

    Returns
    -------
    rates
        deg/s, left positive, median over the conditions, (size, size) by left and right drive. A
        fly that falls counts until then.
    falls
        Share of flies that fell, (size, size).
    """
    count = size * size * conditions
    env = BatchedEnv(
        EnvConfig(task="hybrid_turning", physics=physics, decision_interval=SAMPLING_S),
        count,
        threads,
    )
    seeds = np.tile(first_seed + np.arange(conditions), size * size)
    episodes = [env.draw_episode(i, int(seed)) for i, seed in enumerate(seeds)]
    env.reset(episodes=[replace(episode, init_magnitudes=(0.0,) * 6) for episode in episodes])
    levels = drives(size)
    left, right = np.meshgrid(levels, levels, indexing="ij")
    action = np.repeat(np.stack([left.ravel(), right.ravel()], axis=1), conditions, axis=0)
    turned, time, is_up = np.zeros(count), np.zeros(count), np.ones(count, dtype=bool)
    for k in range(1, round(seconds / SAMPLING_S) + 1):
        before = env.state.yaw
        # who fell no longer moves, nor counts
        is_up &= ~env.step(action, ids=np.flatnonzero(is_up)).terminated
        if k * SAMPLING_S > SETTLING_S:
            change = (env.state.yaw - before + np.pi) % (2 * np.pi) - np.pi
            turned += np.where(is_up, change, 0.0)
            time += np.where(is_up, SAMPLING_S, 0.0)
        if not is_up.any():
            break
    rates = np.rad2deg(turned / np.maximum(time, SAMPLING_S)).reshape(size, size, conditions)
    fell = ~is_up.reshape(size, size, conditions)
    return np.median(rates, axis=2), fell.mean(axis=2)


def relative_difference(rates: Array, reference: Array) -> float:
    """Root mean square difference over the grid ÷ root mean square of the reference."""
    return float(np.sqrt(np.mean((rates - reference) ** 2) / np.mean(reference**2)))


def slope(rates: Array, reference: Array) -> float:
    """By how much the rates are to be divided to fit the reference best, least squares."""
    return float((rates * reference).sum() / (reference**2).sum())
