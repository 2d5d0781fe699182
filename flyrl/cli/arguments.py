"""The command line before any work: jobs of a sweep, and errors with the closest match."""

from __future__ import annotations

import argparse
import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.entry_points import is_entry_point
from flyrl.files import load_yaml
from flyrl.resources import configs_folder, install_command
from flyrl.training.runs import present_names
from flyrl.validation import did_you_mean, one_of

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override
    from omegaconf import DictConfig

EXTRAS: Final = {"joblib": "joblib", "submitit_slurm": "slurm", "submitit_local": "slurm"}
"""Hydra's launcher -> extra of flyrl that brings it."""

GROUPS: Final = (
    "body", "controller", "terrain", "physics", "randomisation", "task", "algo", "training",
    "tuned", "logger", "experiment", "launcher",
)  # fmt: skip
"""Groups that a command line chooses from."""

OWN: Final = ("controller", "task", "terrain")
"""Groups whose choice may be module:attribute, a thing of the user's own."""


_FLAGS: Final = (
    "--help -h",
    "--hydra-help",
    "--version",
    "--resolve",
    "--run -r",
    "--multirun -m",
    "--shell-completion -sc",
)
_OPTIONS: Final = (
    "--cfg -c",
    "--package -p",
    "--config-path -cp",
    "--config-name -cn",
    "--config-dir -cd",
    "--experimental-rerun",
)
"""Hydra's options, without and with a value."""


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
    """

    folder: Path
    is_named: bool
    jobs: tuple[tuple[str, ...], ...]


def unknown_key(given: str, keys: Iterable[str]) -> UsageError:
    """The error for a key that is not among `keys`; it names the closest one, if one is close."""
    if given.rpartition(".")[2] in {"device", "cuda", "gpu"}:
        return UsageError(
            f"there is no key {given!r}: training runs on the CPU, where the physics runs too and "
            "networks as small as these are as fast"
        )
    hint = did_you_mean(given, keys) or " (--cfg job prints all keys)"
    return UsageError(f"there is no key {given!r}{hint}")


def with_own_things(arguments: Sequence[str]) -> list[str]:
    """Write the user's own things as Hydra knows them.

    `task=my_lab:forage task.sources=2` becomes `task=own`, `task.name=my_lab:forage` and
    `++task.sources=2`. Other groups are deleted, and added anew: `~controller`,
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
            words += [f"~{key}", f"+{key}.name={value}"]
            if key == "task":
                words[-2:] = ["task=own", f"task.name={value}"]
        elif key.partition(".")[0] in own:
            words.append(f"++{word}")
        else:
            words.append(_by_present_name(word))
    return words


def _by_present_name(word: str) -> str:
    """Write an override of a setting that had another name by the one that it has."""
    name = word.partition("=")[0].lstrip("+~")
    (present,) = present_names({name: None}, "training.")
    return word.replace(name, present, 1)


def own_overrides(job: Sequence[str]) -> tuple[str, ...]:
    """The overrides of a job without Hydra's and the launcher: what is done, not where."""
    keys = ("launcher=", "hydra.", "hydra/")
    return tuple(item for item in job if not item.lstrip("+~").startswith(keys))


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
    UsageError
        A key, group or choice that does not exist, a text that is no override, or a launcher that
        is not installed.
    """
    from hydra import compose, initialize_config_dir  # noqa: PLC0415
    from hydra.core.override_parser.overrides_parser import OverridesParser  # noqa: PLC0415
    from hydra.errors import HydraException  # noqa: PLC0415
    from hydra.types import RunMode  # noqa: PLC0415
    from omegaconf.errors import OmegaConfBaseException  # noqa: PLC0415

    from flyrl.cli.groups import HYDRA_VERSION, register  # noqa: PLC0415

    register()
    options = parsed_options(arguments)
    if options.shell_completion:
        return None
    more = options.config_dir
    search = [f"hydra.searchpath=['file://{Path(more).resolve()}']"] if more else []
    own = list(filter(None, (more, options.config_path)))
    for each in own:
        for file in sorted(Path(each).rglob("*.yaml")):
            load_yaml(file)  # without aliases, which Hydra would multiply
    folder = str(Path(options.config_path or configs_folder()).resolve())
    name = options.config_name or config_name
    asked: Sequence[str] = options.overrides
    try:
        with initialize_config_dir(folder, job_name=config_name, version_base=HYDRA_VERSION):
            overrides = OverridesParser.create().parse_overrides(list(asked))
            if nameless := [each.input_line for each in overrides if not each.key_or_group]:
                raise UsageError(f"{nameless[0]!r} names no key; write key=value")
            jobs = _jobs(overrides)
            composed: dict[tuple[str, ...], DictConfig] = {}
            for job in jobs:
                asked = job
                choices = _choices(job)
                if choices not in composed:  # else other values of the same keys
                    composed[choices] = compose(name, [*job, *search], return_hydra_config=True)
            ours = next(iter(composed.values())).hydra
            if name == config_name and not own:  # in others, Hydra alone knows what they hold
                known = functools.cache(lambda: [*map(str, compose(name)), *GROUPS, "hydra"])
                for config in composed.values():
                    _check_used(config, overrides, known)
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise _explained(error, config_name, asked) from error
    if options.help or options.hydra_help or options.cfg or options.info:
        return None
    if not (options.multirun or ours.mode == RunMode.MULTIRUN):
        if several := [each.input_line for each in overrides if each.is_sweep_override()]:
            raise UsageError(
                f"{several[0]} names several values: add -m to run each of them, or quotes if it "
                "is one value"
            )
        is_plain = own_overrides(asked) == tuple(asked) and not (own or options.experimental_rerun)
        return next(iter(composed.values())) if is_plain else None
    return Sweep(
        Path(ours.sweep.dir),
        any(each.key_or_group == "hydra.sweep.dir" for each in overrides),
        tuple(own_overrides(job) for job in jobs),
    )


def parsed_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Options of Hydra's on a command line, and the `overrides` beside them."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--info", "-i", nargs="?", const="all")
    for names in _FLAGS:
        parser.add_argument(*names.split(), action="store_true")
    for names in _OPTIONS:
        parser.add_argument(*names.split())
    return parser.parse_args(list(arguments))


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
    return tuple(item for item in job if item.lstrip("+~").partition("=")[0] in GROUPS)


def _check_used(
    config: DictConfig, overrides: Iterable[Override], known: Callable[[], Sequence[str]]
) -> None:
    """Raise UsageError if something would be ignored: a key that nothing reads, a choice.

    Parameters
    ----------
    config
        Composed of them, with Hydra's own.
    overrides
        On the command line.
    known
        Gives the keys at the top, and groups; takes a tenth of a second.
    """
    for override in overrides:
        key, value = override.key_or_group, override.value()
        if override.is_add() or override.is_force_add():
            if key.partition(".")[0] not in known():
                raise unknown_key(key, known())
        elif key in config and config[key] is None and value is not None:
            raise UsageError(f"{override.input_line} has no effect with task={config.task.name}")
        elif key == "experiment" and (more := {*map(str, config)} - {*known()}):
            raise UsageError(
                f"{override.input_line} is for another command: it sets {', '.join(sorted(more))}"
            )


def _explained(  # noqa: PLR0911
    error: Exception, config_name: str, asked: Sequence[str]
) -> UsageError:
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
    from hydra.errors import MissingConfigException, OverrideParseException  # noqa: PLC0415

    from flyrl.cli.groups import composed, groups  # noqa: PLC0415

    if isinstance(error, OverrideParseException):
        return UsageError(
            f"{error.override!r} cannot be read: settings are written key=value, as task=target; "
            "write unusual values in quotes of their own: \"key='a value'\""
        )
    if isinstance(error, MissingConfigException) and error.missing_cfg_file and error.options:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        if group == "hydra/launcher" and choice in EXTRAS:
            return UsageError(f"launcher {choice} needs: {install_command(EXTRAS[choice])}")
        try:
            one_of(group, choice, error.options)
        except ValueError as explained:
            return UsageError(str(explained))
    text = str(error)
    if found := re.match("Could not override '([^']+)'", text):
        key = found[1]
        if key.startswith("hydra"):
            return UsageError(f"there is no key {key!r} (--cfg hydra prints all keys of Hydra's)")
        group, _, rest = key.partition(".")
        others = [item for item in asked if item.partition("=")[0] != key]
        settings = composed(config_name, _choices(others))
        having = [
            name
            for name, choice in groups().get(group, {}).items()
            if rest in _keys(choice) and group in settings
        ]
        if having:
            choices = ",".join(sorted(having))
            return UsageError(f"there is no key {key!r} here, only with {group}={choices}")
        known = [*_keys(settings), "experiment", "launcher"]
        return unknown_key(key, [each for each in known if each != key])
    if text.startswith("Config group override must be"):
        return UsageError(f"a group takes the name of a choice, got {' '.join(_choices(asked))}")
    if text.startswith("Error merging override"):  # without the reason
        text += f": {error.__cause__}"
    return UsageError("; ".join(text.strip().splitlines()))


def _keys(settings: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Every key, dotted, of groups and of values."""
    found = []
    for key, value in settings.items():
        found.append(f"{prefix}{key}")
        if isinstance(value, Mapping):
            found += _keys(value, f"{prefix}{key}.")
    return found
