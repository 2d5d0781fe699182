"""Let every entrant walk the same episodes."""

from __future__ import annotations

import dataclasses
import datetime
import json
import platform
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entrants import make_entrants, reference_name
from flyrl.evaluation.results import Json, Results, Trajectory, episode_row, trajectory
from flyrl.evaluation.summary import summarise
from flyrl.progress import progress_bar
from flyrl.rollouts import OUTCOMES, run_episodes
from flyrl.tasks import Episode, task_record

if TYPE_CHECKING:
    from tqdm import tqdm

PACKAGES: Final = ("flyrl", "mujoco", "numba", "numpy", "scipy")
"""Packages whose versions the results name."""


def evaluate(config: EvaluationConfig) -> Results:
    """Let every entrant walk the same episodes on every terrain, and compare them.

    Raises
    ------
    ValueError
        An entrant, terrain or setting that cannot be used; before anything is simulated.
    """
    entrants = make_entrants(config)
    episodes = {terrain: config.draw_episodes(terrain) for terrain in config.terrain_configs}
    # Every environment's config is made, and with that checked, before the first one runs.
    envs = [
        (entrant, terrain, entrant.env(config, terrain))
        for terrain in config.terrain_configs
        for entrant in entrants
    ]
    rows: list[Json] = []
    trajectories: list[Trajectory] = []
    with progress_bar(
        # whole ms, shown in s: a sum of many small floats could pass the total
        round(len(envs) * config.episodes * config.horizon_s * 1000),
        is_shown=config.progress,
        unit="s",
        unit_scale=1e-3,
        description="evaluating",
        layout="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} simulated s "
        "[{elapsed}<{remaining}, {rate_fmt}]{postfix}",
    ) as bar:
        for entrant, terrain, env_config in envs:
            bar.set_postfix_str(f"{entrant.name}, {terrain.label}")
            env = BatchedEnv(env_config, min(config.num_envs, config.episodes), config.num_threads)
            for record in run_episodes(
                env,
                entrant.policy,
                episodes[terrain],
                controller=entrant.name,
                on_progress=_advance(bar, env_config.decision_interval_s),
            ):
                rows.append(episode_row(record))
                trajectories.append(trajectory(record))
    reference = reference_name(config, entrants)
    rng = np.random.default_rng(config.seed)
    return Results(
        protocol=_protocol(config, entrants, reference, list(episodes.values())),
        episodes=rows,
        summary=summarise(rows, reference, config.horizon_s, rng),
        trajectories=trajectories,
    )


def _advance(bar: tqdm[NoReturn], interval_s: float) -> Callable[[int], object]:
    return lambda decisions: bar.update(round(decisions * interval_s * 1000))


def _protocol(
    config: EvaluationConfig,
    entrants: Sequence[Entrant],
    reference: str,
    episodes: Sequence[Sequence[Episode]],
) -> Json:
    env, task = config.env(config.terrains[0]), config.resolved_task
    record = task_record(task)
    protocol: Json = {
        "command": config.command,
        "created_utc": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **_versions()},
        "seed": config.seed,
        "task": task.name,
        "terms": record["terms"],
        "weights": record["weights"],
        "outcomes": list(dict.fromkeys((*OUTCOMES, *(end.outcome for end in task.terminations)))),
        "horizon_s": config.horizon_s,
        "episodes_per_terrain": config.episodes,
        "reference": reference,
        "entrants": [dict(entrant.record) for entrant in entrants],
        "terrains": [
            {
                "name": terrain.label,
                "config": dataclasses.asdict(terrain),
                "episodes": [dataclasses.asdict(episode) for episode in drawn],
            }
            for terrain, drawn in zip(config.terrain_configs, episodes, strict=True)
        ],
        "body": dataclasses.asdict(env.scene.body),
        "physics": dataclasses.asdict(env.scene.physics),
        "randomisation": dataclasses.asdict(env.resolved_randomisation),
    }
    # As the file holds it: lists, not tuples.
    plain: Json = json.loads(json.dumps(protocol))
    return plain


def _versions() -> dict[str, str]:
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions
