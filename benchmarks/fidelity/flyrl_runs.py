"""Runs of flyrl, started and sampled as the reference's are."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from benchmarks.fidelity.results import Row, row
from benchmarks.fidelity.statistics import Trajectory, trajectory
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig
from flyrl.tasks import TIMEOUT, UNSTABLE
from flyrl.tasks.terms import leg_contacts

SAMPLING_S: Final = 1e-3
"""s, as in `reference.py`; as near as physics steps allow."""


def walk_straight(
    config: EnvConfig, seeds: Sequence[int], seconds: float, num_threads: int = 0
) -> list[Trajectory]:
    """Walk at the drive (1, 1), one fly per seed, from oscillators at magnitude 0.

    Spawn and phases are those that the task draws for the seed; so starts the reference. A fly
    that falls walks on, as the reference's does; one that blows up ends there.
    """
    env = BatchedEnv(config, len(seeds), num_threads)
    episodes = [env.draw_episode(i, seed) for i, seed in enumerate(seeds)]
    env.reset(episodes=[replace(episode, init_magnitudes=(0.0,) * 6) for episode in episodes])
    drive = np.ones((len(seeds), 2))
    samples = [_sample(env)]
    unstable_from = np.full(len(seeds), np.iinfo(np.int64).max)
    # samples until the time is up; a sum of steps may miss it by a hair's breadth
    num_samples = math.ceil(seconds / config.decision_interval_s - 1e-6)
    for k in range(1, num_samples + 1):
        env.step(drive)
        unstable_from[env.state.is_unstable & (unstable_from > k)] = k
        samples.append(_sample(env))
    series = {name: np.array([each[name] for each in samples]) for name in samples[0]}
    series["time"] = np.tile(
        config.decision_interval_s * np.arange(len(samples))[:, None], len(seeds)
    )
    return [
        trajectory({name: values[: unstable_from[i], i] for name, values in series.items()})
        for i in range(len(seeds))
    ]


def rows(
    config: EnvConfig,
    seeds: Sequence[int],
    seconds: float,
    num_threads: int = 0,
    to_row: Callable[..., Row] = row,
    **about: Any,
) -> list[Row]:
    """What is stored of each of `walk_straight`'s runs; `about` says what they are."""
    walks = walk_straight(config, seeds, seconds, num_threads)
    outcomes = [TIMEOUT if walk.time[-1] > seconds - 1e-6 else UNSTABLE for walk in walks]
    return [
        to_row(walk, **about, seed=seed, outcome=outcome)
        for walk, seed, outcome in zip(walks, seeds, outcomes, strict=True)
    ]


def config(controller: str, terrain: str, physics: str | PhysicsConfig) -> EnvConfig:
    """Environment of one cell of the comparison: the current body, sampled every `SAMPLING_S`."""
    settings = PHYSICS_PRESETS[physics] if isinstance(physics, str) else physics
    return EnvConfig(
        task="hybrid_turning",
        controller=controller,
        terrain=terrain,
        physics=physics,
        decision_interval=round(SAMPLING_S / settings.timestep) * settings.timestep,
    )


def _sample(env: BatchedEnv) -> dict[str, np.ndarray]:
    fly = env.flies.state()
    return {
        "position_w": fly.position_w,
        "yaw": fly.yaw,
        "upright": fly.up_b[:, 2],
        "end_effectors_w": fly.end_effectors_w,
        "contact": leg_contacts(env.task_state()) > 0,
        "power": np.maximum(fly.actuator_torques * fly.joint_velocities, 0.0).sum(axis=1),
    }
