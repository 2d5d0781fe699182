"""Hydra's config groups: the choices that flyrl's own tables name, beside the files of `configs/`.

A default is stated once, where it is used: in a dataclass, or in the signature of a task function.
"""

import functools
import hashlib
import importlib.util
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf

from flyrl.entry_points import is_entry_point
from flyrl.files import write_text
from flyrl.resources import configs_folder, tuned_name

if TYPE_CHECKING:
    from flyrl.tasks import TaskFunction

HYDRA_VERSION: Final = "1.3"
"""Hydra's behaviour that the configs are written for."""

OWN: Final = ("controller", "task", "terrain")
"""Groups whose choice may be module:attribute, a thing of the user's own."""


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


def register(arguments: Iterable[str] = ()) -> None:
    """Put the groups into Hydra's store, where the defaults lists of `configs/` find them.

    Parameters
    ----------
    arguments
        Their choices of the form module:attribute, as in `controller=cpg,my_lab:Wave`, become
        choices of Hydra's, too, with any keys; Hydra escapes their colon with a backslash.
    """
    _register_groups()
    for key, _, value in (word.replace("\\", "").partition("=") for word in arguments):
        for name in filter(is_entry_point, value.split(",") if key in OWN else ()):
            node = OmegaConf.create({"name": name}, flags={"struct": False})
            ConfigStore.instance().store(name=name, node=node, group=key)


@functools.cache
def _register_groups() -> None:
    store = ConfigStore.instance()
    # Hydra copies it, and never changes it, for each config that it composes and each group that
    # --help lists: 4 of 5 s there
    vars(store)["__deepcopy__"] = lambda memo: store
    for group, choices in groups().items():
        for name, settings in choices.items():
            package = "_global_" if "defaults" in settings else None
            store.store(name=name, node=dict(settings), group=group, package=package)


def _tuned(*, _root_: DictConfig) -> str:
    """Choice of the group `tuned` that goes with those of task and algorithm."""
    return tuned_name(_root_.get("task"), _root_.get("algo"))


# at import, so that a sweep's job in another process has it; again where a module is loaded anew
OmegaConf.register_new_resolver("flyrl.tuned", _tuned, replace=True)


def composed(config_name: str, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Settings that a command line with these overrides stands for, as plain values."""
    register(overrides)
    folder = str(configs_folder().resolve())
    with initialize_config_dir(folder, job_name=config_name, version_base=HYDRA_VERSION):
        config = compose(config_name, list(overrides))
    values = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    return cast(dict[str, Any], values)
