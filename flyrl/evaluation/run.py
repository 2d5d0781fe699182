"""An evaluation: every entrant walks the same episodes; what is finished is kept on the way."""

from __future__ import annotations

import dataclasses
import datetime
import itertools
import platform
import traceback
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np
import pandas as pd

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.conditions import Condition
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.contrast import contrasts
from flyrl.evaluation.entrants import Entrant, make_entrants
from flyrl.evaluation.episodes import (
    Json,
    Part,
    Parts,
    Trajectory,
    episode_row,
    episode_table,
    trajectory,
    typed,
)
from flyrl.evaluation.metrics import compared_metrics, decisive_metrics, smallest_effects
from flyrl.evaluation.results import Results
from flyrl.evaluation.summary import best_reference, summarise
from flyrl.progress import progress_bar
from flyrl.resources import version
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.simulation.physics import preset_record
from flyrl.tasks import Episode, task_record, task_table
from flyrl.terrains import Terrain
from flyrl.text import printable
from flyrl.validation import plain

if TYPE_CHECKING:
    from tqdm import tqdm

PACKAGES: Final = ("flyrl", "mujoco", "numba", "numpy", "scipy")
"""Packages whose versions the results name."""


def evaluate(
    config: EvaluationConfig,
    folder: str | Path | None = None,
    entrants: Sequence[Entrant] | None = None,
) -> Results:
    """Let every entrant walk the same episodes on every terrain, and compare them.

    An entrant that raises an error is excluded on that terrain, with all its episodes there; the
    others continue.

    Parameters
    ----------
    config
        Who, where, how often.
    folder
        Where each batch of episodes is kept until all are done, so that the same evaluation resumes
        from there after an interruption. None keeps nothing.
    entrants
        What `make_entrants` made of `config`; None makes them.

    Raises
    ------
    ValueError
        An entrant, terrain or setting that cannot be used, before anything is simulated; or every
        entrant raised an error.
    OSError
        The folder cannot be written to.
    """
    if entrants is None:
        entrants = make_entrants(config)
    # Every environment's config is made, and with that checked, before the first one runs.
    walks = [
        _Walk(entrant, terrain, condition, episodes, condition.env(entrant.env(config, terrain)))
        for terrain in config.terrain_configs
        for condition in config.conditions
        for episodes in [config.draw_episodes(terrain, condition)]
        for entrant in entrants
    ]
    protocol = _protocol(config, entrants)
    drawn = {
        terrain.label: [plain(each) for each in config.draw_episodes(terrain)]
        for terrain in config.terrain_configs
    }
    # the first tells episodes from those that another version would draw from the same seeds
    first = [episodes[0] for episodes in drawn.values()]
    parts = Parts(folder, [protocol, config.num_envs, config.paths, _versions(), first])
    tables: list[pd.DataFrame] = []
    examples: list[EpisodeRecord] = []
    trajectories: dict[int, Trajectory] = {}
    crashes: list[Json] = []
    num_rows = 0
    walk_ms = config.episodes * round(1000 * config.horizon_s)
    with progress_bar(
        # whole ms, shown in s: a sum of many small floats could pass the total
        len(walks) * walk_ms,
        is_shown=config.progress,
        unit="s",
        unit_scale=1e-3,
        description="evaluating",
        layout="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} simulated s "
        "[{elapsed}<{remaining}, {rate_fmt}]{postfix}",
    ) as bar:
        for number, walk in enumerate(walks):
            bar.set_postfix_str(", ".join(filter(None, walk.place.values())))
            due = bar.n + walk_ms
            found, filmed, crash = _walk(walk, config, parts, number, bar)
            bar.update(due - bar.n)
            crashes += crash
            examples += filmed
            for table, paths in found:
                trajectories |= {num_rows + row: path for row, path in paths.items()}
                tables.append(table)
                num_rows += len(table)
    if not tables:
        raise ValueError(f"every entrant raised an error; the first: {crashes[0]['error']}")
    rows = typed(pd.concat(tables, ignore_index=True))
    if protocol["reference"] not in rows["controller"].unique():
        protocol["reference"] = best_reference(rows, protocol)
    if config.film == "contrast" and not config.vary:
        protocol["film"] = contrasts(rows, protocol)
    protocol |= {
        "command": config.command,
        "settings": plain(dict(config.settings)),
        "created_utc": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **_versions()},
        "crashes": crashes,
    }
    return Results(
        protocol,
        rows,
        summarise(rows, protocol, np.random.default_rng(config.seed)),
        drawn=drawn,
        trajectories=trajectories,
        examples=examples,
    )


@dataclass(frozen=True, eq=False)
class _Walk:
    """One entrant's episodes on one terrain, under one condition."""

    entrant: Entrant
    terrain: Terrain
    condition: Condition
    episodes: Sequence[Episode]
    env: EnvConfig

    @property
    def place(self) -> dict[str, str]:
        """Controller, terrain and condition, as a crash is recorded."""
        return {
            "controller": self.entrant.name,
            "terrain": self.terrain.label,
            "condition": self.condition.label,
        }


def _walk(
    walk: _Walk, config: EvaluationConfig, parts: Parts, number: int, bar: tqdm[NoReturn]
) -> tuple[list[Part], list[EpisodeRecord], list[Json]]:
    """Walk the batches that `parts` does not hold yet, and keep them there.

    Returns
    -------
    All batches; where nothing is varied, records of the episodes to film that were walked; and, if
    the entrant raised an error, that alone, as it goes on record.
    """
    size = min(config.num_envs, len(walk.episodes))
    env: BatchedEnv | None = None
    found: list[Part] = []
    filmed: list[EpisodeRecord] = []
    to_film = config.filmed()[walk.terrain.label]
    begun, walked = bar.n, 0

    def count(decisions: int) -> None:
        nonlocal walked
        walked += decisions
        # rounded down, once for all: a bar that passes its total cannot be drawn
        bar.update(begun + int(1000 * walk.env.decision_interval_s * walked) - bar.n)

    for start in range(0, len(walk.episodes), size):
        batch = walk.episodes[start : start + size]
        part = parts.read(number, start)
        if part is None:
            env = env or BatchedEnv(walk.env, size, config.num_threads)
            try:
                records = run_episodes(
                    env,
                    walk.entrant.policy,
                    batch,
                    controller=walk.entrant.name,
                    first_index=start,
                    on_progress=count,
                )
            except Exception as error:
                # a policy may be anybody's code, and raise anything
                text = printable(f"{type(error).__name__}: {error!s:.1000}")
                lines = "".join(traceback.format_exception(error))
                return [], [], [{**walk.place, "error": text, "traceback": lines}]
            rows = [episode_row(record, walk.condition.label) for record in records]
            kept = records[: max(0, config.paths - start)]
            part = episode_table(rows), dict(enumerate(map(trajectory, kept)))
            parts.write(number, start, part)
            if not walk.condition.name:
                filmed += [each for each in records if each.index in to_film]
        found.append(part)
    return found, filmed, []


def _protocol(config: EvaluationConfig, entrants: Sequence[Entrant]) -> Json:
    """Settings that determine the results, but for versions."""
    env, task = config.env(config.terrains[0]), config.resolved_task
    record = task_record(task)
    protocol = {
        "seed": config.seed,
        "task": task.name,
        "parameters": {name: record[name] for name in task.parameters},
        "drive_time_constant": task.drive_time_constant_s,
        "terms": record["terms"],
        "without": record["without"],
        "weights": record["weights"],
        "decisive": decisive_metrics(task),
        "compared": compared_metrics(task),
        "table": task_table(task),
        "outcomes": task.outcomes[1:],
        "horizon_s": config.horizon_s,
        "episodes_per_terrain": config.episodes,
        "reference": config.reference,
        "smallest_effects": {**smallest_effects(task), **config.smallest_effects},
        "entrants": [entrant.record for entrant in entrants],
        "terrains": [
            {"name": terrain.label, "config": terrain} for terrain in config.terrain_configs
        ],
        "study": config.study,
        "vary": config.vary,
        "body": env.scene.body,
        "physics": env.scene.physics,
        "physics_preset": preset_record(env.scene.physics),
        "randomisation": env.resolved_randomisation,
    }
    recorded: Json = plain(protocol)  # as the file holds it
    return recorded


def _versions() -> dict[str, str]:
    return {package: version(package) or "not installed" for package in PACKAGES}


def walk_examples(
    config: EvaluationConfig,
    entrants: Sequence[Entrant],
    walked: Sequence[EpisodeRecord] = (),
    chosen: Json | None = None,
) -> list[EpisodeRecord]:
    """Records of the episodes to `film`: as in the evaluation, to the bit, with all of the gait.

    Parameters
    ----------
    config
        Of the evaluation; where it varies something, nothing is varied here.
    entrants
        Of the evaluation.
    walked
        Those that were kept from the evaluation; the others are walked again.
    chosen
        As in `EvaluationConfig.filmed`.

    Returns
    -------
    One per terrain, episode and entrant, in this order, but for those that raise an error.
    """
    found = {(record.controller, record.terrain, record.index): record for record in walked}
    filmed = config.filmed(chosen)

    def walk(entrant: Entrant) -> None:
        for terrain in config.terrain_configs:
            label = terrain.label
            due = [i for i in filmed[label] if (entrant.name, label, i) not in found]
            if not due:
                continue
            drawn = config.draw_episodes(terrain)
            env = BatchedEnv(entrant.env(config, terrain), len(due), config.num_threads)
            try:
                records = run_episodes(
                    env, entrant.policy, [drawn[i] for i in due], controller=entrant.name
                )
            except Exception:
                # it crashed in the evaluation, too
                continue
            for index, record in zip(due, records, strict=True):
                found[entrant.name, label, index] = dataclasses.replace(record, index=index)

    # single flies leave cores idle; as in films, each entrant is walked by one thread
    with ThreadPoolExecutor(config.num_threads or None) as pool:
        list(pool.map(walk, entrants))
    return [
        found[entrant.name, terrain, index]
        for terrain, indices in filmed.items()
        for index, entrant in itertools.product(indices, entrants)
        if (entrant.name, terrain, index) in found
    ]
