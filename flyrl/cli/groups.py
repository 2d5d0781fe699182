"""Hydra's config groups: the choices that flyrl's own tables name, beside the files of `configs/`.

A default is stated once, where it is used: in a dataclass, or in the signature of a task function.
"""

import functools
import hashlib
import importlib.util
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from flyrl.files import write_text

if TYPE_CHECKING:
    from flyrl.tasks import TaskFunction


@functools.cache
def groups() -> Mapping[str, Mapping[str, Any]]:
    """Choices of each group by name, as plain values.

    Read from a file beside the byte code, which is written anew whenever a source changed: the
    dataclasses stand beside kernels and models, whose libraries take longer to load than all else.
    """
    file = Path(importlib.util.cache_from_source(__file__)).with_suffix(".json")
    sources = _sources_digest()
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(file.read_text(encoding="utf-8"))
        if kept["sources"] == sources:
            return cast(Mapping[str, Mapping[str, Any]], kept["groups"])
    text = json.dumps({"sources": sources, "groups": _make_groups()})
    with suppress(OSError):  # where it cannot be written, it is made every time
        file.parent.mkdir(exist_ok=True)
        write_text(file, text)
    return cast(Mapping[str, Mapping[str, Any]], json.loads(text)["groups"])


def _sources_digest() -> str:
    """SHA-256 over names, sizes and times of all sources of flyrl, by which Python knows them."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        facts = path.stat()
        digest.update(f"{path}\0{facts.st_size}\0{facts.st_mtime_ns}\0".encode())
    return digest.hexdigest()


def _make_groups() -> dict[str, dict[str, Any]]:
    from flyrl.cli.config import evaluation_defaults  # noqa: PLC0415
    from flyrl.controllers import CONTROLLERS  # noqa: PLC0415
    from flyrl.envs.config import BODIES  # noqa: PLC0415
    from flyrl.simulation.physics import PHYSICS_PRESETS  # noqa: PLC0415
    from flyrl.simulation.randomisation import RANDOMISATIONS  # noqa: PLC0415
    from flyrl.terrains import TERRAINS  # noqa: PLC0415
    from flyrl.training.algorithms import ALGORITHMS  # noqa: PLC0415
    from flyrl.training.config import ScheduleConfig  # noqa: PLC0415
    from flyrl.training.loggers import LOGGERS  # noqa: PLC0415

    return {
        "body": {name: asdict(body) for name, body in BODIES.items()},
        "controller": {
            name: asdict(kind()) for name, kind in CONTROLLERS.items() if name != "joints"
        },
        "terrain": {name: asdict(terrain) for name, terrain in TERRAINS.items()},
        "physics": {name: asdict(preset) for name, preset in PHYSICS_PRESETS.items()},
        "randomisation": {name: asdict(ranges) for name, ranges in RANDOMISATIONS.items()},
        "task": dict(_tasks()),
        "algo": {name: {"name": name, **each} for name, each in ALGORITHMS.items()},
        "training": {"default": asdict(ScheduleConfig())},
        "evaluation": {"default": evaluation_defaults()},
        "logger": {
            "none": {"name": "none"},
            **{name: {"name": name, **asdict(kind())} for name, kind in LOGGERS.items()},
        },
    }


def _tasks() -> Iterator[tuple[str, dict[str, Any]]]:
    from flyrl.tasks import TASKS, JointTargets, task_record  # noqa: PLC0415
    from flyrl.tasks.function import TIME_LIMIT  # noqa: PLC0415

    for name, function in TASKS.items():
        if isinstance(function().actions, JointTargets):
            continue  # its 42 angles are no decisions to learn
        settings = {**task_record(function()), "decision_interval": None}
        settings["time_limit"] = settings["time_limit"] or TIME_LIMIT
        yield name, settings if function.worm is None else _with_worm(function, settings)


def _with_worm(function: "TaskFunction", settings: Mapping[str, Any]) -> dict[str, Any]:
    """Task for worms, which brings its body and its physics, and has no legs to control."""
    from flyrl.envs.config import BODIES  # noqa: PLC0415

    body = next(name for name, each in BODIES.items() if each == function.worm)
    return {
        "defaults": [{"override /body": body}, {"override /physics": "worm"}],
        "controller": None,
        "task": settings,
    }


def group_names() -> set[str]:
    """Groups that a command line chooses from: of flyrl's tables, and of `configs/`."""
    return {*groups(), "experiment", "launcher", "tuned"}
