"""Evaluations: policies and controllers on the same episodes, their tables and their report."""

from __future__ import annotations

import html
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

from flyrl.controllers import Controller
from flyrl.entry_points import is_entry_point, load_module
from flyrl.envs.config import env_record, with_task
from flyrl.evaluation import (
    Entrant,
    EvaluationConfig,
    Results,
    ResultsError,
    load_results,
    make_entrants,
    measure_drive_map,
    measure_steering,
    walk_examples,
    write_results,
)
from flyrl.evaluation import evaluate as walk_episodes
from flyrl.evaluation.config import ENV_GROUPS, ReportConfig
from flyrl.evaluation.episodes import drop_parts, episodes_digest
from flyrl.evaluation.results import RESULTS_FILES
from flyrl.files import OutputFolder, usable_folder, write_text
from flyrl.policies.bundle import policy_file
from flyrl.policies.laws import FIXED, is_law, split_legs
from flyrl.progress import progress_bar as make_bar
from flyrl.report import read_origin, record_videos, write_report
from flyrl.report.html import REPORT_FILE, Additions, format_report
from flyrl.report.video import FILMED
from flyrl.tasks import Task, TaskSettings
from flyrl.terrains import Flat, Terrain
from flyrl.training.runs import is_run, read_run
from flyrl.validation import plain

_MAX_LISTED: Final = 5
"""Episodes that differ from a report's which are listed one by one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison(Results):
    """Results of an evaluation that was walked in this process, and can be filmed.

    Attributes
    ----------
    config
        What was asked for.
    entrants
        Who took part.
    """

    config: EvaluationConfig
    entrants: Sequence[Entrant]

    @property
    def is_complete(self) -> bool:
        """Whether everyone is in it: who crashed on a terrain is excluded there."""
        return not self.protocol["crashes"]

    def report(self, path: str | Path = "report.html", **shown: Any) -> Path:
        """Write the report to one HTML file that needs no other; return its path.

        Parameters
        ----------
        path
            Of the file; its folder is made if missing.
        shown
            Settings of `ReportConfig`: `videos`, `camera`, `close_ups`, `drive_map`.

        Raises
        ------
        TypeError, ValueError
            There is no such setting, or value of one.
        OSError
            The file cannot be written.
        """
        path = Path(path)
        usable_folder(path.parent)  # before what takes long
        write_text(path, format_report(self, **self._additions(ReportConfig(**shown))))
        return path

    def write(self, folder: str | Path, **shown: Any) -> Path:
        """Write all that `python evaluate.py` writes to a folder; return the report's path.

        That is results.json, episodes.csv and trajectories.npz, report.html, and the report's
        figures and tables as files.

        Parameters
        ----------
        folder
            Made if missing.
        shown
            Settings of `ReportConfig`: `videos`, `camera`, `close_ups`, `drive_map`.

        Raises
        ------
        OSError
            The folder cannot be written to, or holds such a file that flyrl did not write.
        """
        folder = Path(folder)
        OutputFolder(folder).check_free(REPORT_FILE)
        write_results(self, folder)
        drop_parts(folder)
        return write_report(self, folder, **self._additions(ReportConfig(**shown)))

    def _additions(self, parts: ReportConfig) -> Additions:
        """Make what the report shows beside the results."""
        config, entrants = self.config, self.entrants
        missing = {(crash["controller"], crash["terrain"]) for crash in self.protocol["crashes"]}
        view = replace(FILMED, camera=parts.camera)
        has_walks = not config.vary  # a report of doses has no place for single walks
        has_films = parts.videos and has_walks
        chosen = self.protocol.get("film")
        films = (config, entrants, missing, view, chosen)
        filmed, note = record_videos(*films) if has_films else ([], None)
        examples = []
        with make_bar(1, is_shown=config.progress, unit=" parts", description="reporting") as bar:
            terrain = config.terrain_configs[0]
            has_map = parts.close_ups and parts.drive_map and config.legs is not None
            if parts.close_ups and has_walks:
                examples = walk_examples(config, entrants, self.examples, chosen)
            additions = Additions(
                videos=filmed,
                examples=examples,
                # grounds that differ from start to start would tell little of a drive
                drive_map=measure_drive_map(config, Flat() if terrain.random else terrain)
                if has_map
                else None,
                steering=measure_steering(config, entrants, terrain) if parts.close_ups else None,
                curves=training_evaluations(self.protocol["entrants"]),
                note=note,
            )
            bar.update()
        return additions

    def _repr_html_(self) -> str:
        shown = self.summary[["terrain", "condition", "controller", "episodes", "success_rate"]]
        crashes = "".join(
            f"<p>{html.escape(each['controller'])} crashed on {html.escape(each['terrain'])} "
            f"and is excluded there: {html.escape(each['error'])}</p>"
            for each in self.protocol["crashes"]
        )
        return shown.to_html(index=False) + crashes


def evaluate(
    entrants: Any = None,
    task: TaskSettings | Task = "target",
    *,
    terrains: Any = ("flat",),
    episodes: int = 50,
    folder: str | Path | None = None,
    progress_bar: bool = True,
    **settings: Any,
) -> Comparison:
    """Let policies and controllers walk the same episodes, with the bits of `evaluate.py`.

    Parameters
    ----------
    entrants
        One or several of: a run; the name of a fixed controller ("cpg", "hybrid", "pursuit", …) or
        of a policy that comes with flyrl ("target-flat"), a run folder or a policy file; a leg
        controller, or its settings with the name; a function `(time_s, observation) -> drive`; an
        object with the `predict` of Stable-Baselines3 (`evaluation.entrants.own_policy`); any of
        these, or a leg controller of your own, as module:attribute. None takes the fixed
        controllers that go with the task.
    task
        Name of the task, a mapping with its name and parameters, or a task of your own.
    terrains
        Names, configs, or their fields as mappings.
    episodes
        Per terrain; the same ones for everybody.
    folder
        Where each batch of episodes is kept until all are done, so that the same evaluation resumes
        from there after an interruption; `write` it there in the end. None keeps nothing.
    progress_bar
        Whether to draw one on stderr.
    settings
        Of `EvaluationConfig`: `seed`, `body`, `physics`, `randomisation`, `vary`, `reference`, …;
        and of the task (`distance`, …: docs/tasks.md).

    Raises
    ------
    TypeError
        A setting that does not exist; the message names the closest one. A ValueError, too.
    ValueError
        An entrant or a value that cannot be used; or every entrant raised an error.
    """
    known = [item.name for item in fields(EvaluationConfig)]
    known = [name for name in known if name not in _OWN_ARGUMENTS]
    config = EvaluationConfig(
        **_entrants(entrants),
        terrains=(terrains,) if isinstance(terrains, str | Mapping | Terrain) else tuple(terrains),
        episodes=episodes,
        progress=progress_bar,
        **with_task({"task": task, **settings}, known, "an evaluation has no setting"),
    )
    return compare(replace(config, settings=_record(config)), folder)


_OWN_ARGUMENTS: Final = ("policies", "controllers", "progress", "command", "settings")
"""Fields of an EvaluationConfig that have arguments of other names, or none."""


def compare(
    config: EvaluationConfig,
    folder: str | Path | None = None,
    entrants: Sequence[Entrant] | None = None,
) -> Comparison:
    """Let everyone walk the episodes; warn on stderr of those who crashed.

    Parameters
    ----------
    config
        Who, where, how often.
    folder
        As in `evaluate`.
    entrants
        What `make_entrants` made of `config`; None makes them.

    Raises
    ------
    ValueError, OSError
        As `flyrl.evaluation.evaluate` does.
    """
    if entrants is None:
        entrants = make_entrants(config)
    results = walk_episodes(config, folder, entrants)
    for crash in results.protocol["crashes"]:
        print(
            f"warning: {crash['controller']} crashed on {crash['terrain']} and is excluded there: "
            f"{crash['error']}",
            file=sys.stderr,
        )
    return Comparison(**vars(results), config=config, entrants=entrants)


def results_folder(path: str | Path) -> Path:
    """Make a folder for results and report if it is missing; return it.

    Raises
    ------
    OSError
        It cannot be written to, or a file of somebody else's is in the way.
    """
    folder = usable_folder(Path(path))
    OutputFolder(folder).check_free(*RESULTS_FILES, REPORT_FILE)
    return folder


def differences_from_report(path: Path, results: Results) -> tuple[bool, list[str]]:
    """Whether results are those of a report to the bit; and lines that name what differs.

    Raises
    ------
    ValueError
        The file is no report.
    """
    origin, protocol = read_origin(path), results.protocol
    now = {entrant["name"]: entrant["sha256"] for entrant in protocol["entrants"]}
    lines = [
        f"policy {name}: another file than then"
        for name, digest in origin["policies"].items()
        if now.get(name) != digest
    ]
    lines += [
        f"{package}: {version}, in the repeat {protocol['versions'].get(package)}"
        for package, version in origin["versions"].items()
        if protocol["versions"].get(package) != version
    ]
    is_same = episodes_digest(results.episodes) == origin["episodes_sha256"]
    return is_same, lines if is_same else lines + _episodes_differ(path.parent, results)


def _episodes_differ(folder: Path, results: Results) -> list[str]:
    """Differences from the rows beside the report, a line each."""
    try:
        before = load_results(folder).episodes
    except ResultsError as error:
        return [f"which ones cannot be said: {error}"]
    if len(before) != len(results.episodes):
        return [f"{len(before)} episodes, in the repeat {len(results.episodes)}"]
    before, now = before.align(results.episodes, join="outer", axis=1)
    changed = before.compare(now)
    lines = [f"{len(changed)} of {len(now)} episodes differ"]
    for row in changed.head(_MAX_LISTED).index:
        key = changed.loc[row].dropna().index[0][0]
        one, other = before.loc[row], now.loc[row]
        lines.append(
            f"{one['controller']} on {one['terrain']}, episode {one['episode']}: "
            f"{key} {one[key]}, in the repeat {other[key]}"
        )
    return lines


def _entrants(given: Any) -> dict[str, Any]:
    """Policies and fixed controllers of an EvaluationConfig."""
    if given is None:
        return {"policies": (), "controllers": None}
    if isinstance(given, str | os.PathLike | Mapping) or not isinstance(given, Iterable):
        given = [given]
    # runs and paths by their path
    names = [os.fspath(each) if isinstance(each, os.PathLike) else each for each in given]
    policies = tuple(name for name in names if not _is_fixed(name))
    for name in policies:
        if isinstance(name, str) and ":" not in name:
            policy_file(split_legs(name)[0], FIXED)  # one that is not there may be misspelt
    return {"policies": policies, "controllers": tuple(filter(_is_fixed, names))}


def _is_fixed(entrant: Any) -> bool:
    """Whether it is a controller, or the name of one: built in, or a class of the user's own."""
    if not isinstance(entrant, str) or Path(entrant).exists():
        return isinstance(entrant, Controller | Mapping)
    entrant, _ = split_legs(entrant)
    if is_entry_point(entrant):
        defined = load_module(entrant, "entrants", "my_lab:law").get(entrant.partition(":")[2])
        return isinstance(defined, type) and issubclass(defined, Controller)
    return is_law(entrant)


def _record(config: EvaluationConfig) -> dict[str, Any]:
    """Settings by which `flyrl reproduce` repeats it, as in `configs/evaluate.yaml`, if it can."""
    task = config.task.get("name") if isinstance(config.task, Mapping) else config.task
    if not all(isinstance(each, str) for each in (task, *config.policies)):
        return {}
    env = env_record(config.env(config.terrains[0]))
    own = {
        item.name: plain(getattr(config, item.name))
        for item in fields(config)
        if item.name not in (*ENV_GROUPS, "terrains", "progress", "command", "settings")
    }
    terrains = [env_record(config.env(terrain))["terrain"] for terrain in config.terrains]
    return {**{key: env[key] for key in ENV_GROUPS}, **own, "terrains": terrains}


def training_evaluations(
    entrants: Sequence[Mapping[str, Any]],
) -> dict[str, Sequence[Mapping[str, float]]]:
    """Held-out evaluations during training, by entrant; of those alone that come from a run folder.

    Parameters
    ----------
    entrants
        Of the protocol of results.
    """
    folders = {
        entrant["name"]: Path(entrant["source"]).parent
        for entrant in entrants
        if entrant["kind"] == "learned"
    }
    runs = {name: read_run(folder) for name, folder in folders.items() if is_run(folder)}
    return {name: run.evaluations for name, run in runs.items() if run.evaluations}
