"""Checking the command line before any work: unknown keys and choices, with the closest match."""

import difflib
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NoReturn, cast

from hydra import compose, initialize_config_dir
from hydra._internal.utils import get_args_parser
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from flyrl.resources import configs_folder
from flyrl.validation import one_of

HYDRA_VERSION = "1.3"
"""Hydra's behaviour that the configs are written for."""


class UsageError(ValueError):
    """A command line that cannot be meant so."""


def fail(error: Exception) -> NoReturn:
    """Print the error and exit as a wrong command line does, with status 2."""
    print(f"error: {error}", file=sys.stderr)
    raise SystemExit(2) from None


def plain_values(config: DictConfig) -> dict[str, Any]:
    """Composed config as plain, resolved values; an unresolvable one ends the program."""
    try:
        values = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        fail(error)
    return cast(dict[str, Any], values)


def unknown_key(given: str, keys: Iterable[str]) -> UsageError:
    """The error for a key that is not among `keys`; it names the closest one."""
    closest = difflib.get_close_matches(given, list(keys), n=1, cutoff=0.0)[0]
    return UsageError(f"there is no key {given!r}; did you mean {closest!r}?")


def check_arguments(config_name: str, arguments: Sequence[str]) -> None:
    """Check the overrides on a command line against `configs/`.

    Parameters
    ----------
    config_name
        Name of the primary config.
    arguments
        Without the program.

    Raises
    ------
    UsageError
        A key, group or choice that does not exist, or a text that is no override.
    """
    options = get_args_parser().parse_args(list(arguments))
    if options.config_path or options.config_name or options.config_dir:
        return  # the user's own configs: Hydra alone knows what is in them
    folder = str(configs_folder().resolve())
    try:
        with initialize_config_dir(folder, job_name=config_name, version_base=HYDRA_VERSION):
            overrides = OverridesParser.create().parse_overrides(options.overrides)
            groups = _groups()
            for override in overrides:
                if override.key_or_group in groups:
                    _check_choice(override, groups[override.key_or_group])
            chosen = [
                str(override.input_line)
                for override in overrides
                if override.key_or_group in groups and not override.is_sweep_override()
            ]
            keys = set(_keys(compose(config_name, chosen))) | set(groups)
            for override in overrides:
                _check_key(override, keys)
            plain = [str(o.input_line) for o in overrides if not o.is_sweep_override()]
            compose(config_name, plain, return_hydra_config=True)
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise UsageError(str(error).partition("\nSee http")[0]) from error


def _groups() -> dict[str, list[str]]:
    """Config groups and their choices."""
    loader = GlobalHydra.instance().config_loader()
    names = loader.list_groups("")
    return {
        name: loader.get_group_options(name, results_filter=ObjectType.CONFIG)
        for name in names
        if name != "hydra"
    }


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


def _check_key(override: Override, keys: set[str]) -> None:
    key = override.key_or_group
    is_ours = not key.startswith("hydra") and override.package is None
    if is_ours and not override.is_add() and not override.is_force_add() and key not in keys:
        raise unknown_key(key, keys)
