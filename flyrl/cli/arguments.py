"""Checking the command line before any work: unknown keys and choices, with the closest match."""

import importlib.util
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final, cast

from hydra import compose, initialize_config_dir
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.utils import get_args_parser
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from flyrl.cli.groups import config_groups
from flyrl.entry_points import is_entry_point
from flyrl.files import load_yaml, usable_folder
from flyrl.resources import configs_folder, install_command
from flyrl.training.tuned import tuned_name
from flyrl.validation import did_you_mean, one_of

HYDRA_VERSION = "1.3"
"""Hydra's behaviour that the configs are written for."""


EXTRAS: Final = {"joblib": "joblib", "slurm": "slurm", "submitit": "slurm", "ray": "ray"}
"""Launcher of `configs/launcher` -> extra of flyrl that it needs."""

_MODULES: Final = {
    "joblib": "hydra_plugins.hydra_joblib_launcher",
    "slurm": "hydra_plugins.hydra_submitit_launcher",
    "ray": "ray",
}
"""Extra -> module that it installs."""


def _tuned(*, _root_: DictConfig) -> str:
    """Choice of the group `tuned` that goes with those of task and algorithm."""
    return tuned_name(_root_.get("task"), _root_.get("algo"))


# `configs/train.yaml` asks for it; again where a module is loaded anew
OmegaConf.register_new_resolver("flyrl.tuned", _tuned, replace=True)


class UsageError(ValueError):
    """A command line that cannot be meant so."""


@dataclass(frozen=True)
class Sweep:
    """A command line that asks for many jobs.

    Attributes
    ----------
    folder
        Where they are to go.
    is_named
        Whether the command line named the folder, so that it may hold an earlier sweep.
    jobs
        The overrides of each, without those that say where it runs.
    is_elsewhere
        Whether they run in other processes, so that their own progress is not seen here.
    """

    folder: Path
    is_named: bool
    jobs: tuple[tuple[str, ...], ...]
    is_elsewhere: bool


def plain_values(config: DictConfig) -> dict[str, Any]:
    """Composed config as plain, resolved values."""
    values = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    return cast(dict[str, Any], values)


def unknown_key(given: str, keys: Iterable[str]) -> UsageError:
    """The error for a key that is not among `keys`; it names the closest one, if one is close."""
    if given.rpartition(".")[2] in {"device", "cuda", "gpu"}:
        return UsageError(
            f"there is no key {given!r}: training runs on the CPU, where the physics runs too and "
            "networks as small as these are as fast"
        )
    hint = did_you_mean(given, keys) or " (--cfg job prints all keys)"
    return UsageError(f"there is no key {given!r}{hint}")


OWN: Final = ("controller", "task", "terrain")
"""Groups whose choice may be module:attribute, a thing of the user's own."""


def with_own_things(arguments: Sequence[str]) -> list[str]:
    """Write the user's own things as Hydra knows them.

    `task=my_lab:forage task.sources=2` becomes `task=own`, `task.name=my_lab:forage` and
    `++task.sources=2`. A group without a choice `own` is deleted, and added anew: `~controller`,
    `+controller.name=my_lab:Wave`. A sweep over choices, `controller=cpg,my_lab:Wave`, is one over
    names.
    """
    own = {
        key: value
        for key, equals, value in (word.partition("=") for word in arguments)
        if equals and key in OWN and any(map(is_entry_point, value.split(",")))
    }
    words: list[str] = []
    for word in arguments:
        key, _, value = word.partition("=")
        if own.get(key) == value:
            if "own" in config_groups()[key]:
                words += [f"{key}=own", f"{key}.name={value}"]
            else:
                words += [f"~{key}", f"+{key}.name={value}"]
        elif key.partition(".")[0] in own:
            words.append(f"++{word}")
        else:
            words.append(word)
    return words


def check_arguments(config_name: str, arguments: Sequence[str]) -> Sweep | None:
    """Check the overrides on a command line against `configs/`.

    Parameters
    ----------
    config_name
        Name of the primary config.
    arguments
        Without the program.

    Returns
    -------
    The sweep that the command line asks for, if it does.

    Raises
    ------
    UsageError
        A key, group or choice that does not exist, a text that is no override, or a launcher that
        is not installed.
    """
    options = get_args_parser().parse_args(list(arguments))
    is_our_own = not (options.config_path or options.config_name or options.config_dir)
    folder = str(Path(options.config_path or configs_folder()).resolve())
    name = options.config_name or config_name
    more = options.config_dir
    if more and not Path(more).is_dir():
        raise UsageError(f"--config-dir must be a folder, got {more!r}")
    search = [f"hydra.searchpath=['file://{Path(more).resolve()}']"] if more else []
    for own in filter(None, (options.config_path, more)):
        for file in sorted(Path(own).rglob("*.yaml")):
            load_yaml(file)  # without aliases, which Hydra would multiply
    _check_words(options.overrides)
    try:
        with initialize_config_dir(folder, job_name=config_name, version_base=HYDRA_VERSION):
            parser = OverridesParser.create(GlobalHydra.instance().config_loader())
            overrides = parser.parse_overrides(options.overrides)
            if nameless := [each.input_line for each in overrides if not each.key_or_group]:
                raise UsageError(f"{nameless[0]!r} names no key; write key=value")
            jobs = _jobs(overrides)
            plain = tuple(str(o.input_line) for o in overrides if not o.is_sweep_override())
            composed = {}
            if is_our_own:  # in others, Hydra alone knows what they hold
                composed = _check_overrides(config_name, overrides, jobs)
            if options.cfg or options.info or options.help or options.hydra_help:
                return None
            if composed and len(plain) == len(overrides):
                (ours,) = (config.hydra for config in composed.values())
            else:
                ours = compose(name, [*plain, *search], return_hydra_config=True).hydra
            if not (options.multirun or ours.mode == RunMode.MULTIRUN):
                _check_single(overrides, Path(ours.run.dir))
                return None
            return Sweep(
                Path(ours.sweep.dir),
                any(override.key_or_group == "hydra.sweep.dir" for override in overrides),
                tuple(own_overrides(job) for job in jobs),
                "basic_launcher" not in ours.launcher._target_,
            )
    except OverrideParseException as error:
        raise UsageError(
            f"{error.override!r} cannot be read; write unusual values in quotes of their own: "
            "\"key='a value'\""
        ) from error
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        text = str(error).partition("\nSee http")[0]
        if text.startswith("Error merging override"):  # without the reason
            text += f": {error.__cause__}".partition("\n")[0]
        raise UsageError(text) from error


def _check_single(overrides: Sequence[Override], folder: Path) -> None:
    """Check what only a run that is no sweep needs: one value per key, and Hydra's folder."""
    for override in overrides:
        if override.is_sweep_override():
            raise UsageError(
                f"{override.input_line} names several values: add -m to run each of them, or "
                "quotes if it is one value"
            )
    usable_folder(folder)  # Hydra makes it, too, with a traceback where it cannot


def _check_words(words: Sequence[str]) -> None:
    """Raise UsageError at a word without "="; say how to write it, as far as that is clear."""
    for word, after in zip_longest(words, words[1:], fillvalue="="):
        if "=" in word or word.startswith("~"):
            continue
        groups = [group for group, choices in config_groups().items() if word in choices]
        example = "task=target"
        if groups:
            example = f"{groups[0]}={word}"
        elif "=" not in after:
            example = f"{word}={after}"
        raise UsageError(f"settings are written key=value; for {word!r}, write {example}")


def _check_overrides(
    config_name: str, overrides: Sequence[Override], jobs: Sequence[tuple[str, ...]]
) -> dict[tuple[str, ...], DictConfig]:
    """Check choices, keys, and that every combination of choices in a sweep can be composed.

    Returns
    -------
    What was composed, with Hydra's own: for each of these combinations the first job with it.
    """
    taken = _groups_of(config_name)
    groups = {name: choices for name, choices in config_groups().items() if name in taken}
    if any(override.key_or_group == "experiment" for override in overrides):
        groups["experiment"] = _experiments(config_name, groups["experiment"])
    for override in overrides:
        if override.key_or_group in groups:
            _check_choice(override, groups[override.key_or_group])
    if "launcher" in groups:
        _check_launcher(overrides)
    composed: dict[tuple[str, ...], DictConfig] = {}
    checked = set()
    for job in jobs:
        choices = tuple(item for item in job if item.lstrip("+~").partition("=")[0] in groups)
        if choices in checked:
            continue  # other values of the same keys
        checked.add(choices)
        try:
            composed[job] = compose(config_name, list(job), return_hydra_config=True)
        except HydraException:
            _explain(config_name, job, choices, groups)
            raise
        _check_taken(overrides, composed[job])
    _check_added(config_name, overrides, groups)
    return composed


def _groups_of(config_name: str) -> set[str]:
    """Groups that the defaults of a command's config choose from."""
    defaults = load_yaml(configs_folder() / f"{config_name}.yaml")["defaults"]
    entries = [entry for entry in defaults if isinstance(entry, Mapping)]
    return {key.split()[-1].partition("@")[0] for entry in entries for key in entry}


def _check_added(config_name: str, overrides: Sequence[Override], groups: Iterable[str]) -> None:
    """Raise UsageError if a key that is added with "+" stands where nothing would read it."""
    for override in overrides:
        if override.is_add() or override.is_force_add():
            keys = [*map(str, compose(config_name)), *groups, "hydra"]
            if override.key_or_group.partition(".")[0] not in keys:
                raise unknown_key(override.key_or_group, keys)


def _check_taken(overrides: Sequence[Override], config: DictConfig) -> None:
    """Raise UsageError if a choice has no effect, as that of a controller with a worm."""
    for override in overrides:
        key = override.key_or_group
        if key in config and config[key] is None and override.value() is not None:
            raise UsageError(f"{override.input_line} has no effect with task={config.task.name}")


def _explain(
    config_name: str,
    job: Sequence[str],
    choices: Sequence[str],
    groups: Mapping[str, list[str]],
) -> None:
    """Raise UsageError if a key is why a job cannot be composed."""
    keys = set(_keys(compose(config_name, list(choices)))) | set(groups)
    for override in OverridesParser.create().parse_overrides(list(job)):
        if _is_unknown(override, keys):
            _check_not_elsewhere(config_name, override.key_or_group, groups)
            raise unknown_key(override.key_or_group, keys)


def _jobs(overrides: Sequence[Override]) -> list[tuple[str, ...]]:
    """Overrides of every job, in the order of a sweep; of a single run, if nothing is swept.

    A sweep over an interval, which another sweeper of Hydra's may draw from, is left out.
    """
    discrete = [o for o in overrides if not o.is_sweep_override() or o.is_discrete_sweep()]
    (batch,) = BasicSweeper.split_arguments(discrete, max_batch_size=None)
    return [tuple(job) for job in batch]


def own_overrides(job: Sequence[str]) -> tuple[str, ...]:
    """The overrides of a job without Hydra's and the launcher: what is done, not where."""
    keys = ("launcher=", "hydra.", "hydra/")
    return tuple(item for item in job if not item.lstrip("+~").startswith(keys))


def _check_launcher(overrides: Sequence[Override]) -> None:
    for override in overrides:
        if override.key_or_group == "launcher":
            extra = EXTRAS[str(override.value())]
            if importlib.util.find_spec(_MODULES[extra]) is None:
                package = _MODULES[extra].rpartition(".")[2].replace("_", "-")
                raise UsageError(f"{override.input_line} needs {package}: {install_command(extra)}")


def _experiments(config_name: str, names: Sequence[str]) -> list[str]:
    """Those of the experiments that are of this command: that set nothing but its keys."""
    known = {"defaults", *map(str, compose(config_name))}
    folder = configs_folder() / "experiment"
    return [name for name in names if known.issuperset(load_yaml(folder / f"{name}.yaml"))]


def _keys(config: Any, prefix: str = "") -> Iterator[str]:
    """Every key, dotted, of nodes and leaves."""
    plain = OmegaConf.to_container(config, resolve=False) if not prefix else config
    if isinstance(plain, Mapping):
        for key, value in plain.items():
            name = prefix + str(key)
            yield name
            yield from _keys(value, f"{name}.")


def _check_choice(override: Override, choices: list[str]) -> None:
    value: Any = override.value()
    is_expanded_by_hydra = override.is_sweep_override() and not isinstance(value, ChoiceSweep)
    if override.is_delete() or is_expanded_by_hydra:
        return
    given = value.list if isinstance(value, ChoiceSweep) else [value]
    for choice in given:
        one_of(override.key_or_group, choice, choices)
        # without aliases, which Hydra would multiply
        load_yaml(configs_folder() / override.key_or_group / f"{choice}.yaml")


def _is_unknown(override: Override, keys: set[str]) -> bool:
    key = override.key_or_group
    is_ours = not key.startswith("hydra") and override.package is None
    return is_ours and not override.is_add() and not override.is_force_add() and key not in keys


def _check_not_elsewhere(config_name: str, key: str, groups: Mapping[str, list[str]]) -> None:
    """Raise UsageError if other choices of the key's group have it."""
    group = key.partition(".")[0]
    if group not in compose(config_name):
        return
    having = [
        choice
        for choice in groups.get(group, [])
        if key in set(_keys(compose(config_name, [f"{group}={choice}"])))
    ]
    if having:
        raise UsageError(f"there is no key {key!r} here, only with {group}={','.join(having)}")
