"""Steered flies: how often they fall, how far they tilt, how fast they go and turn.

A run is one fly on one ground under one kind of drives: a sequence of `drives.py`, which the
reference walks too, or the law `pursuit` in the task `target`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.fidelity.drives import HOLD_S, KINDS, sequence
from benchmarks.fidelity.flyrl_runs import Series, drive
from benchmarks.fidelity.statistics import FALL_TILT, Trajectory
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.metrics import PATH_SAMPLING_S
from flyrl.policies.laws import fixed_policy
from flyrl.simulation.physics import PhysicsConfig
from flyrl.tasks import TIMEOUT
from flyrl.tasks.task import FALL

Array = NDArray[np.float64]
Row = dict[str, Any]

REFERENCE: Final = Path(__file__).with_name("reference_steering.json")
"""Steered runs of `reference.py`, collected."""

PURSUIT: Final = "pursuit"
ALL_KINDS: Final = (PURSUIT, *KINDS)
TERRAINS: Final = ("gapped", "blocks", "mixed", "hills")
SECONDS: Final = 1.5
"""s that a sequence of drives lasts."""

_AT_ONCE: Final = 100


def steer(
    physics: str | PhysicsConfig,
    terrain: str,
    kind: str,
    seeds: Sequence[int],
    num_threads: int = 0,
    seconds: float = SECONDS,
) -> list[Row]:
    """Steer one fly per seed until it falls, leaves, blows up, succeeds or time is up.

    Parameters
    ----------
    physics
        Name of a preset, or settings.
    terrain
        Name of the ground.
    kind
        One of `ALL_KINDS`.
    seeds
        Of the starts and of the drives. Under a sequence the oscillators start at magnitude 0, as
        the reference's do.
    num_threads
        0 takes one per CPU.
    seconds
        How long a sequence lasts; the task says how long "pursuit" does.
    """
    rows = []
    name = physics if isinstance(physics, str) else "settings"
    about = {"physics": name, "terrain": terrain, "kind": kind}
    with tqdm(total=len(seeds), desc=f"{name} {terrain} {kind}", unit="fly") as progress:
        for first in range(0, len(seeds), _AT_ONCE):
            part = seeds[first : first + _AT_ONCE]
            drives = None
            if kind != PURSUIT:
                drives = np.stack([sequence(kind, seed, seconds) for seed in part])
            found = walk(physics, terrain, part, drives, num_threads)
            rows += [{**about, "seed": seed, **row} for seed, row in zip(part, found, strict=True)]
            progress.update(len(part))
    return rows


def walk(
    physics: str | PhysicsConfig,
    terrain: str,
    seeds: Sequence[int],
    drives: Array | None,
    num_threads: int = 0,
) -> list[Row]:
    """Walk with one sequence of drives per seed, (n, k, 2), or by "pursuit"; `figures` of each."""
    task = "target" if drives is None else "hybrid_turning"
    config = EnvConfig(task=task, physics=physics, terrain=terrain, decision_interval=HOLD_S)
    env = BatchedEnv(config, len(seeds), num_threads)
    if drives is None:
        policy = fixed_policy(PURSUIT, env.task)
        count = round((env.task.time_limit_s or SECONDS) / HOLD_S)
        driven = drive(
            env, seeds, lambda k: policy.predict(env.observe())[0], count, magnitude=None
        )
    else:
        actions = env.task.actions.of(drives)
        driven = drive(env, seeds, lambda k: actions[:, k], drives.shape[1])
    series, ends, outcomes = driven
    return [
        figures({name: values[: end + 1, i] for name, values in series.items()}, outcome)
        for i, (end, outcome) in enumerate(zip(ends, outcomes.tolist(), strict=True))
    ]


def figures(series: Series, outcome: str) -> Row:
    """What is kept of a run.

    Parameters
    ----------
    series
        `flyrl_runs.pose` of one fly; one sample per `HOLD_S` from the start on.
    outcome
        How it ended.

    Returns
    -------
    "outcome"; "seconds"; "tilt_deg", that of the thorax at every sample before the end of a run
    that ended by itself, else at all but the first, whole degrees; "speed", length of the path
    through points every 0.1 s over time, mm/s; "yaw_deg", the whole change of yaw, left positive.
    """
    seconds = HOLD_S * (len(series["yaw"]) - 1)
    tilt = np.rad2deg(np.arccos(np.clip(series["upright"], -1.0, 1.0)))[1:]
    kept = tilt if outcome == TIMEOUT else tilt[:-1]
    every = round(PATH_SAMPLING_S / HOLD_S)
    points = series["position_w"][::every, :2]
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turned = np.unwrap(series["yaw"])
    return {
        "outcome": outcome,
        "seconds": round(seconds, 4),
        "tilt_deg": np.rint(kept).astype(int).tolist(),
        "speed": round(float(moved.mean() / PATH_SAMPLING_S), 3) if len(moved) else None,
        "yaw_deg": round(float(np.rad2deg(turned[-1] - turned[0])), 1),
    }


def reference_row(walk: Trajectory, *, terrain: str, drives: str, seed: int, **about: Any) -> Row:
    """What is stored of a run of `reference.py`, as of those of `steer`.

    It ends where flyrl's does, at the first sample with a thorax tilted beyond 75 degrees.
    """
    every = round(HOLD_S / float(walk.time[1] - walk.time[0]))
    series = {name: getattr(walk, name)[::every] for name in ("position_w", "yaw", "upright")}
    outcome = about["outcome"]
    fallen = np.flatnonzero(series["upright"] < np.cos(FALL_TILT))
    if len(fallen):
        outcome = FALL
        series = {name: values[: fallen[0] + 1] for name, values in series.items()}
    where = {"physics": "flygym", "terrain": terrain, "kind": drives, "seed": seed}
    return {**where, **figures(series, outcome)}


def place(row: Row) -> tuple[int, ...]:
    """Place of a run among the others: terrain, drives, seed."""
    return TERRAINS.index(row["terrain"]), ALL_KINDS.index(row["kind"]), row["seed"]
