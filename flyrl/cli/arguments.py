"""The command line before any work: choices, jobs of a sweep, errors with the closest match."""

import argparse
import functools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final, cast

from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from flyrl.cli.groups import group_names, groups
from flyrl.entry_points import is_entry_point
from flyrl.files import load_yaml
from flyrl.resources import configs_folder, install_command, tuned_name
from flyrl.training.runs import flat, present_names
from flyrl.validation import did_you_mean

HYDRA_VERSION: Final = "1.3"
"""Hydra's behaviour that the configs are written for."""

OWN: Final = ("controller", "task", "terrain")
"""Groups whose choice may be module:attribute, a thing of the user's own."""

EXTRAS: Final = {"joblib": "joblib", "submitit_slurm": "slurm", "submitit_local": "slurm"}
"""Hydra's launcher -> extra of flyrl that brings it."""


@dataclass(frozen=True)
class Sweep:
    """A command line that asks for many jobs.

    Attributes
    ----------
    folder
        Where they are to go.
    jobs
        The overrides of each, without those that say where it runs.
    """

    folder: Path
    jobs: tuple[tuple[str, ...], ...]


def unknown_key(given: str, keys: Iterable[str]) -> ValueError:
    """The error for a key that is not among `keys`; it names the closest one, if one is close."""
    if given.rpartition(".")[2] in {"device", "cuda", "gpu"}:
        return ValueError(
            f"there is no key {given!r}: training runs on the CPU, where the physics runs too and "
            "networks as small as these are as fast"
        )
    part = "hydra" if given.startswith("hydra") else "job"
    hint = did_you_mean(given, keys) or f" (--cfg {part} prints all keys)"
    return ValueError(f"there is no key {given!r}{hint}")


def by_present_name(word: str) -> str:
    """Write an override of a setting that had another name by the one that it has."""
    name = word.partition("=")[0].lstrip("+~")
    (present,) = present_names({name: None}, "training.")
    return word.replace(name, present, 1)


def own_overrides(job: Sequence[str]) -> tuple[str, ...]:
    """The overrides of a job without Hydra's and the launcher: what is done, not where."""
    keys = ("launcher=", "hydra.", "hydra/")
    return tuple(item for item in job if not item.lstrip("+~").startswith(keys))


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


def check_arguments(config_name: str, arguments: Sequence[str]) -> Sweep | DictConfig | None:
    """Compose what the overrides on a command line ask for, with every choice that is swept.

    Parameters
    ----------
    config_name
        Name of the primary config.
    arguments
        Without the program.

    Returns
    -------
    The sweep that the command line asks for; else the config of a run, with Hydra's own; or None,
    where Hydra has more to do than to compose it: to show something, or as its own settings say.

    Raises
    ------
    ValueError
        A key, group or choice that does not exist, a text that is no override, or a launcher that
        is not installed.
    """
    options, words = _parsed(arguments)
    register(words)
    own = list(filter(None, (options.config_dir, options.config_path)))
    for file in (file for folder in own for file in sorted(Path(folder).rglob("*.yaml"))):
        load_yaml(file)  # without aliases, which Hydra would multiply
    if options.config_name or options.shell_completion:
        return None
    more = options.config_dir
    search = [f"hydra.searchpath=['file://{Path(more).resolve()}']"] if more else []
    folder = str(Path(options.config_path or configs_folder()).resolve())
    asked: Sequence[str] = words
    try:
        with initialize_config_dir(folder, job_name=config_name, version_base=HYDRA_VERSION):
            overrides = OverridesParser.create().parse_overrides(words)
            if nameless := [each.input_line for each in overrides if not each.key_or_group]:
                raise ValueError(f"{nameless[0]!r} names no key; write key=value")
            jobs = _jobs(overrides)
            configs: dict[tuple[str, ...], DictConfig] = {}
            for asked in jobs:
                choices = _choices(asked)
                if choices not in configs:  # else other values of the same keys
                    overridden = [*asked, *search]
                    configs[choices] = compose(config_name, overridden, return_hydra_config=True)
            can_add = any(word.startswith(("+", "experiment=")) for word in words)
            known = [*map(str, compose(config_name))] if can_add and not own else []
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise _explained(error, config_name, asked) from error
    for config in configs.values():
        _check_used(config, overrides, known)
    config = next(iter(configs.values()))
    if options.is_shown:
        return None
    if options.multirun or config.hydra.mode == RunMode.MULTIRUN:
        return Sweep(Path(config.hydra.sweep.dir), tuple(map(own_overrides, jobs)))
    if len(jobs) > 1:
        several = next(each.input_line for each in overrides if each.is_sweep_override())
        raise ValueError(
            f"{several} names several values: add -m to run each of them, or quotes if it is one "
            "value"
        )
    is_plain = own_overrides(asked) == tuple(asked) and not own
    return config if is_plain else None


def _parsed(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Options of Hydra's on a command line, with `is_shown`; and the overrides beside them."""
    parser = argparse.ArgumentParser(add_help=False)
    for names in ("--multirun -m", "--shell-completion -sc"):
        parser.add_argument(*names.split(), action="store_true")
    for names in ("--config-dir -cd", "--config-path -cp", "--config-name -cn"):
        parser.add_argument(*names.split())
    options, words = parser.parse_known_args(list(arguments))
    options.is_shown = any(word.startswith("-") for word in words)
    if options.is_shown:  # beside options, some of which have a value
        words = [word for word in words if "=" in word and not word.startswith("-")]
    return options, words


def _jobs(overrides: Sequence[Override]) -> list[tuple[str, ...]]:
    """Overrides of every job, as Hydra's sweeper writes them; of a single run, if nothing is swept.

    A sweep over an interval, which another sweeper of Hydra's may draw from, is left out.
    """
    values: dict[str, list[str]] = {}
    for each in overrides:
        key = each.get_key_element()
        if not each.is_sweep_override():
            values[key] = [f"{key}={each.get_value_element_as_str()}"]
        elif each.is_discrete_sweep():
            values[key] = ["=".join((key, value)) for value in each.sweep_string_iterator()]
    return list(product(*values.values()))


def _choices(job: Iterable[str]) -> tuple[str, ...]:
    """Those overrides of a job that choose from a group, on which its keys depend."""
    return tuple(item for item in job if item.lstrip("+~").partition("=")[0] in group_names())


def _check_used(config: DictConfig, overrides: Iterable[Override], known: Sequence[str]) -> None:
    """Raise ValueError if something would be ignored: a key that nothing reads, a choice.

    Parameters
    ----------
    config
        Composed of them, with Hydra's own.
    overrides
        On the command line.
    known
        Keys at the top; none where any may be there.
    """
    for each in overrides:
        key = each.key_or_group
        if key in config and config[key] is None and each.value() is not None:
            raise ValueError(f"{each.input_line} has no effect with task={config.task.name}")
    unknown = {*map(str, config if known else ())} - {*known, "hydra"}
    for key in (each.key_or_group.partition(".")[0] for each in overrides):
        if key in unknown:
            raise unknown_key(key, known)
    if unknown:
        choice = f"experiment={config.hydra.runtime.choices.experiment}"
        raise ValueError(f"{choice} is for another command: it sets {', '.join(sorted(unknown))}")


def _explained(error: Exception, config_name: str, asked: Sequence[str]) -> ValueError:
    """The error for what Hydra could not compose: in a line, with the closest match.

    Parameters
    ----------
    error
        Hydra's, OmegaConf's, or our own.
    config_name
        Name of the primary config.
    asked
        The overrides.
    """
    text = str(error)
    if isinstance(error, OverrideParseException):
        text = (
            f"{error.override!r} cannot be read: settings are written key=value, as task=target; "
            "write unusual values in quotes of their own: \"key='a value'\""
        )
    elif isinstance(error, MissingConfigException) and error.missing_cfg_file and error.options:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        if group == "hydra/launcher" and choice in EXTRAS:
            text = f"launcher {choice} needs: {install_command(EXTRAS[choice])}"
        else:
            options = ", ".join(map(repr, error.options))
            hint = did_you_mean(choice, error.options)
            text = f"{group} must be one of {options}, got {choice!r}{hint}"
    elif found := re.match("Could not override '([^']+)'", text):
        key = found[1]
        group, _, rest = key.partition(".")
        others = _choices(item for item in asked if item.partition("=")[0] != key)
        settings = composed(config_name, others)
        choices = groups().get(group, {}) if group in settings else {}
        having = sorted(name for name, choice in choices.items() if rest in flat(choice))
        if group == "algo" in settings and _can_be_added(settings["algo"]["name"], rest):
            text = f"algo={settings['algo']['name']} has no default for {key!r}: add it by +{key}="
        elif having:
            text = f"there is no key {key!r} here, only with {group}={','.join(having)}"
        else:
            return unknown_key(key, {*flat(settings), *settings, "experiment", "launcher"} - {key})
    elif text.startswith("Config group override must be"):
        text = f"a group takes the name of a choice, got {' '.join(_choices(asked))}"
    elif text.startswith("Error merging override"):  # without the reason
        text += f": {error.__cause__}"
    return ValueError("; ".join(text.strip().splitlines()))


def _can_be_added(algo: str, setting: str) -> bool:
    from flyrl.training.algorithms import further_settings  # noqa: PLC0415 - takes torch

    return setting in further_settings(algo)
