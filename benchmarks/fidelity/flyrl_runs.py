"""Runs of flyrl, started and sampled as the reference's are."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.fidelity.results import Row, row
from benchmarks.fidelity.statistics import Trajectory, trajectory
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig
from flyrl.tasks import RUNNING, TIMEOUT, UNSTABLE
from flyrl.tasks.terms import leg_contacts

Array = NDArray[np.float64]
Series = dict[str, NDArray[Any]]
"""Samples by the names of the attributes of `Trajectory`, (t, n, …)."""

SAMPLING_S: Final = 1e-3
"""s, as in `reference.py`; as near as physics steps allow."""


def pose(env: BatchedEnv) -> Series:
    """Place, heading and tilt of all flies."""
    fly = env.flies.state()
    return {"position_w": fly.position_w, "yaw": fly.yaw, "upright": fly.up_b[:, 2]}


def gait(env: BatchedEnv) -> Series:
    """All that `Trajectory` has."""
    fly = env.flies.state()
    return {
        **pose(env),
        "end_effectors_w": fly.end_effectors_w,
        "contact": leg_contacts(env.task_state()) > 0,
        "power": np.maximum(fly.actuator_torques * fly.joint_velocities, 0.0).sum(axis=1),
    }


def drive(
    env: BatchedEnv,
    seeds: Sequence[int],
    action: Callable[[int], Array],
    decisions: int,
    *,
    magnitude: float | None = 0.0,
    walks_on: bool = False,
    sample: Callable[[BatchedEnv], Series] = pose,
) -> tuple[Series, NDArray[np.intp], NDArray[np.str_]]:
    """Drive one fly per seed, and sample all at the start and after every decision.

    Parameters
    ----------
    env
        As many flies as seeds.
    seeds
        Of the spawn and phases that the task draws; so starts the reference.
    action
        Of all flies, (n, 2), by the number of the decision.
    decisions
        How many, at most.
    magnitude
        Of the oscillators at the start, 0 as the reference's; None draws it.
    walks_on
        Whether a fly whose episode ends walks on, as the reference's does, unless it blows up.
    sample
        What to sample.

    Returns
    -------
    The samples; of each fly the number of decisions until its end, (n,); and its outcome, (n,).
    """
    episodes = [env.config.sample_episode(int(seed)) for seed in seeds]
    if magnitude is not None:
        episodes = [replace(each, init_magnitudes=(magnitude,) * 6) for each in episodes]
    env.reset(episodes=episodes)
    samples = [sample(env)]
    ends = np.full(env.num_envs, decisions)
    outcomes = np.full(env.num_envs, RUNNING, dtype="U32")
    for k in range(decisions):
        going = outcomes == RUNNING
        if not going.any():
            break
        transition = env.step(action(k), ids=None if walks_on else np.flatnonzero(going))
        samples.append(sample(env))
        ended = going & (env.state.is_unstable if walks_on else transition.done)
        ends[ended] = k + 1
        outcomes[ended] = np.where(env.state.is_unstable, UNSTABLE, transition.outcome)[ended]
    outcomes[outcomes == RUNNING] = TIMEOUT
    series = {name: np.array([each[name] for each in samples]) for name in samples[0]}
    return series, ends, outcomes


def walk_straight(
    config: EnvConfig, seeds: Sequence[int], seconds: float, num_threads: int = 0
) -> list[tuple[Trajectory, str]]:
    """Walk at the drive (1, 1), one fly per seed; how, and the outcome.

    A fly that falls walks on; one that blows up ends there.
    """
    straight = np.ones((len(seeds), 2))
    # samples until the time is up; a sum of steps may miss it by a hair's breadth
    decisions = math.ceil(seconds / config.decision_interval_s - 1e-6)
    env = BatchedEnv(config, len(seeds), num_threads)
    series, ends, outcomes = drive(
        env, seeds, lambda k: straight, decisions, walks_on=True, sample=gait
    )
    time = config.decision_interval_s * np.arange(len(series["yaw"]))
    kept = np.where(outcomes == UNSTABLE, ends, ends + 1)  # without the sample of one that blew up
    walks = [
        trajectory({"time": time[:n]} | {name: each[:n, i] for name, each in series.items()})
        for i, n in enumerate(kept)
    ]
    return list(zip(walks, outcomes.tolist(), strict=True))


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


def rows(
    physics: str,
    terrain: str,
    controller: str,
    seeds: Sequence[int],
    num_threads: int = 0,
    seconds: float = 1.5,
    settings: Callable[[str, str, str], EnvConfig] = config,
    to_row: Callable[..., Row] = row,
) -> list[Row]:
    """What is stored of each of `walk_straight`'s runs in the environment of a cell."""
    env = settings(controller, terrain, physics)
    about = {"terrain": terrain, "controller": controller, "physics": physics}
    walks = walk_straight(env, seeds, seconds, num_threads)
    return [
        to_row(walk, **about, seed=seed, outcome=outcome)
        for seed, (walk, outcome) in zip(seeds, walks, strict=True)
    ]
