"""Yaw rate over a grid of drives, to tell whether a preset turns as another does."""

import numpy as np

from benchmarks.fidelity.flyrl_runs import Array, drive
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PhysicsConfig
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW, TIMEOUT

SAMPLING_S = 0.01
SETTLING_S = 0.3
"""s from the start that do not count: the fly drops and the oscillators get going."""


def levels(size: int) -> Array:
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
    config = EnvConfig(task="hybrid_turning", physics=physics, decision_interval=SAMPLING_S)
    seeds = np.tile(first_seed + np.arange(conditions), size * size)
    left, right = np.meshgrid(levels(size), levels(size), indexing="ij")
    action = np.repeat(np.stack([left.ravel(), right.ravel()], axis=1), conditions, axis=0)
    series, ends, outcomes = drive(
        BatchedEnv(config, count, threads),
        seeds.tolist(),
        lambda k: action,
        round(seconds / SAMPLING_S),
    )
    fell = outcomes != TIMEOUT
    yaw = np.unwrap(series["yaw"], axis=0)
    last = ends - fell  # the decision of the fall does not count
    first = np.minimum(round(SETTLING_S / SAMPLING_S), last)
    turned = yaw[last, np.arange(count)] - yaw[first, np.arange(count)]
    rates = np.rad2deg(turned / np.maximum((last - first) * SAMPLING_S, SAMPLING_S))
    shape = (size, size, conditions)
    return np.median(rates.reshape(shape), axis=2), fell.reshape(shape).mean(axis=2)


def relative_difference(rates: Array, reference: Array) -> float:
    """Root mean square difference over the grid ÷ root mean square of the reference."""
    return float(np.sqrt(np.mean((rates - reference) ** 2) / np.mean(reference**2)))


def slope(rates: Array, reference: Array) -> float:
    """By how much the rates are to be divided to fit the reference best, least squares."""
    return float((rates * reference).sum() / (reference**2).sum())
