"""An evaluation: every entrant walks the same episodes; what is finished is kept on the way."""

from __future__ import annotations

import dataclasses
import datetime
import hashlib
import json
import platform
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

import numpy as np
import pandas as pd

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.record import plain
from flyrl.evaluation.conditions import Condition
from flyrl.evaluation.config import EvaluationConfig, LazySequence
from flyrl.evaluation.entrant import Entrant
from flyrl.evaluation.entrants import best_reference, make_entrants
from flyrl.evaluation.metrics import SMALLEST_EFFECTS, compared_metrics, decisive_metrics
from flyrl.evaluation.results import Results
from flyrl.evaluation.rows import (
    Json,
    Trajectory,
    episode_row,
    episode_table,
    joined,
    pack_trajectories,
    plain_rows,
    trajectory,
    unpack_trajectories,
)
from flyrl.evaluation.summary import summarise
from flyrl.files import OutputFolder, load_arrays
from flyrl.progress import progress_bar
from flyrl.resources import version
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.simulation.physics import preset_record
from flyrl.tasks import Episode, task_record, task_table
from flyrl.terrains import Terrain
from flyrl.text import printable

PARTS_FOLDER: Final = "parts"

Part = tuple[pd.DataFrame, list[Trajectory]]
"""Rows of a batch, and the paths of the first of them."""


class Parts:
    """Batches of episodes in a folder, of an evaluation of certain settings.

    Parameters
    ----------
    folder
        Of the results. None keeps nothing.
    settings
        Plain JSON values; what was walked with others does not count.
    """

    def __init__(self, folder: Path | None, settings: Any) -> None:
        self._folder = None if folder is None else OutputFolder(folder)
        text = json.dumps(settings, sort_keys=True)
        self._digest = np.frombuffer(hashlib.sha256(text.encode()).digest(), dtype=np.uint8)

    def read(self, place: Sequence[int]) -> Part | None:
        """Rows and paths of a batch; None where there are none, or not whole.

        Parameters
        ----------
        place
            Numbers that tell the batch from all others.
        """
        if self._folder is None:
            return None
        try:
            arrays = load_arrays(self._folder.path / _name(place))
            if not np.array_equal(arrays["settings"], self._digest):
                return None
            rows = episode_table(json.loads(arrays["rows"].tobytes()))
            return rows, unpack_trajectories(arrays)
        except (OSError, KeyError, TypeError, ValueError):
            return None

    def write(self, place: Sequence[int], part: Part) -> None:
        """Keep a batch.

        Raises
        ------
        OSError
            The folder cannot be written to.
        """
        if self._folder is None:
            return
        rows, paths = part
        text = np.frombuffer(json.dumps(list(plain_rows(rows))).encode(), dtype=np.uint8)
        with self._folder.replacing(_name(place)) as partial:
            np.savez_compressed(
                partial, settings=self._digest, rows=text, **pack_trajectories(paths)
            )


def _name(place: Sequence[int]) -> str:
    return f"{PARTS_FOLDER}/{'-'.join(map(str, place))}.npz"


def drop_parts(folder: Path) -> None:
    """Drop the batches in a folder of results, once these hold them."""
    output = OutputFolder(folder)
    output.remove(*output.files(PARTS_FOLDER))


if TYPE_CHECKING:
    from tqdm import tqdm

PACKAGES: Final = ("flyrl", "mujoco", "numba", "numpy", "scipy")
"""Packages whose versions the results name."""


def evaluate(config: EvaluationConfig, folder: str | Path | None = None) -> Results:
    """Let every entrant walk the same episodes on every terrain, and compare them.

    An entrant that raises an error is out of that terrain, with all its episodes there; the others
    go on.

    Parameters
    ----------
    config
        Who, where, how often.
    folder
        Where each batch of episodes is kept until all are done, so that the same evaluation goes on
        from there after an interruption. None keeps nothing.

    Raises
    ------
    ValueError
        An entrant, terrain or setting that cannot be used, before anything is simulated; or every
        entrant raised an error.
    OSError
        The folder cannot be written to.
    """
    entrants = make_entrants(config)
    # Every environment's config is made, and with that checked, before the first one runs.
    walks = [
        _Walk(entrant, terrain, condition, condition.env(entrant.env(config, terrain)), config)
        for terrain in config.terrain_configs
        for condition in config.conditions
        for entrant in entrants
    ]
    protocol = _protocol(config, entrants)
    parts = Parts(
        None if folder is None else Path(folder),
        [protocol, config.num_envs, config.paths, _versions(), _first_episodes(config)],
    )
    tables: list[pd.DataFrame] = []
    examples: list[EpisodeRecord] = []
    trajectories: dict[int, Trajectory] = {}
    num_rows = 0
    crashes: list[Json] = []
    with progress_bar(
        # whole ms, shown in s: a sum of many small floats could pass the total
        round(len(walks) * config.episodes * config.horizon_s * 1000),
        is_shown=config.progress,
        unit="s",
        unit_scale=1e-3,
        description="evaluating",
        layout="{desc} {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} simulated s "
        "[{elapsed}<{remaining}, {rate_fmt}]{postfix}",
    ) as bar:
        for number, walk in enumerate(walks):
            bar.set_postfix_str(walk.text)
            due = bar.n + round(config.episodes * config.horizon_s * 1000)
            try:
                found = walk.batches(parts, number, bar, examples)
            except _CrashError as crash:
                crashes.append(walk.crash(crash))
                bar.update(due - bar.n)
                continue
            for table, paths in found:
                trajectories.update(enumerate(paths, start=num_rows))
                tables.append(table)
                num_rows += len(table)
    if not tables:
        raise ValueError(f"every entrant raised an error; the first: {crashes[0]['error']}")
    rows = joined(tables)
    walked = list(rows["controller"].unique())
    reference = protocol["reference"]
    if reference not in walked:
        reference = best_reference(
            rows, protocol["entrants"], config.horizon_s, config.resolved_task
        )
    return Results(
        protocol={
            **protocol,
            "command": config.command,
            "settings": plain(dict(config.settings)),
            "created_utc": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "versions": {"python": platform.python_version(), **_versions()},
            "reference": reference,
            "crashes": crashes,
        },
        episodes=rows,
        summaries=summarise(
            rows,
            reference,
            config.horizon_s,
            np.random.default_rng(config.seed),
            config.vary,
            config.resolved_task,
        ),
        drawn={
            terrain.label: _plain_episodes(config.draw_episodes(terrain))
            for terrain in config.terrain_configs
        },
        trajectories=trajectories,
        examples=examples,
    )


class _CrashError(Exception):
    """An entrant raised an error, which is the cause."""


@dataclass
class _Walk:
    """One entrant's episodes on one terrain, under one condition."""

    entrant: Entrant
    terrain: Terrain
    condition: Condition
    env_config: EnvConfig
    config: EvaluationConfig

    @property
    def text(self) -> str:
        """Who, where and how."""
        return ", ".join(
            filter(None, (self.entrant.name, self.terrain.label, self.condition.label))
        )

    def batches(
        self, parts: Parts, number: int, bar: tqdm[NoReturn], examples: list[EpisodeRecord]
    ) -> list[Part]:
        """Walk the batches that `parts` does not hold yet, keep them there, and return all.

        Where nothing is varied, records of the episodes to film are appended to `examples`.
        """
        episodes = self.config.draw_episodes(self.terrain, self.condition)
        size = min(self.config.num_envs, len(episodes))
        env: BatchedEnv | None = None
        found, filmed = [], []
        for start in range(0, len(episodes), size):
            batch = episodes[start : start + size]
            part = parts.read((number, start))
            if part is None:
                if env is None:
                    env = BatchedEnv(self.env_config, size, self.config.num_threads)
                records = self._walk(env, batch, start, bar)
                part = self._part(records, start)
                if not self.condition.name:
                    filmed += [each for each in records if each.index in self.config.film]
                parts.write((number, start), part)
            else:
                bar.update(round(len(batch) * self.config.horizon_s * 1000))
            found.append(part)
        examples += filmed
        return found

    def _walk(
        self, env: BatchedEnv, batch: Sequence[Episode], start: int, bar: tqdm[NoReturn]
    ) -> list[EpisodeRecord]:
        try:
            return run_episodes(
                env,
                self.entrant.policy,
                batch,
                controller=self.entrant.name,
                first_index=start,
                on_progress=_advance(bar, self.env_config.decision_interval_s),
            )
        except Exception as error:
            # a policy may be anybody's code, and raise anything
            raise _CrashError from error

    def _part(self, records: Sequence[EpisodeRecord], start: int) -> Part:
        table = episode_table([episode_row(record, self.condition.label) for record in records])
        kept = max(0, self.config.paths - start)
        return table, list(map(trajectory, records[:kept]))

    def crash(self, crash: _CrashError) -> Json:
        """What is put on record of an entrant that raised an error."""
        error = crash.__cause__
        return {
            "controller": self.entrant.name,
            "terrain": self.terrain.label,
            "condition": self.condition.label,
            "error": printable(f"{type(error).__name__}: {error!s:.1000}"),
            "traceback": "".join(traceback.format_exception(error)),
        }


def _advance(bar: tqdm[NoReturn], interval_s: float) -> Callable[[int], object]:
    return lambda decisions: bar.update(round(decisions * interval_s * 1000))


def _protocol(config: EvaluationConfig, entrants: Sequence[Entrant]) -> Json:
    """What determines the results, but for versions."""
    env, task = config.env(config.terrains[0]), config.resolved_task
    record = task_record(task)
    protocol: Json = {
        "seed": config.seed,
        "task": task.name,
        "parameters": {name: record[name] for name in task.parameters},
        "terms": record["terms"],
        "without": record["without"],
        "weights": record["weights"],
        "decisive": decisive_metrics(task),
        "compared": compared_metrics(task),
        "table": task_table(task),
        "outcomes": list(task.outcomes[1:]),
        "horizon_s": config.horizon_s,
        "episodes_per_terrain": config.episodes,
        "reference": config.reference,
        "smallest_effects": {
            **SMALLEST_EFFECTS,
            **{term.name: term.smallest_effect for term in task.errors},
            **config.smallest_effects,
        },
        "entrants": [dict(entrant.record) for entrant in entrants],
        "terrains": [
            {
                "name": terrain.label,
                "config": dataclasses.asdict(terrain),
            }
            for terrain in config.terrain_configs
        ],
        "study": config.study,
        "vary": {name: list(values) for name, values in config.vary.items()},
        "body": dataclasses.asdict(env.scene.body),
        "physics": dataclasses.asdict(env.scene.physics),
        "physics_preset": preset_record(env.scene.physics),
        "randomisation": dataclasses.asdict(env.resolved_randomisation),
    }
    # As the file holds it: lists, not tuples.
    plain: Json = json.loads(json.dumps(protocol))
    return plain


def _plain_episodes(episodes: Sequence[Episode]) -> Sequence[Json]:
    """Episodes as plain JSON values, made when asked for."""
    return LazySequence(len(episodes), lambda index: plain(dataclasses.asdict(episodes[index])))


def _first_episodes(config: EvaluationConfig) -> list[Json]:
    """What tells episodes from those that another version would draw from the same seeds."""
    drawn = map(config.draw_episodes, config.terrain_configs)
    return [plain(dataclasses.asdict(episodes[0])) for episodes in drawn]


def _versions() -> dict[str, str]:
    return {package: version(package) or "not installed" for package in PACKAGES}
