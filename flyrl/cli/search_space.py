"""The search space of `flyrl tune`: which settings are searched, and what each may be."""

from __future__ import annotations

import copy
import itertools
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Final

from flyrl.cli.arguments import unknown_key
from flyrl.files import load_yaml
from flyrl.resources import configs_folder
from flyrl.training.runs import flat
from flyrl.validation import one_of

_RANGE: Final = ("low", "high", "log", "step")
_FIXED: Final = (
    "seed",
    "training.evaluation_interval",
    "training.evaluation_episodes",
    "training.evaluation_seed",
)
"""Settings that decide what a trial is measured on, or how lucky it is."""
_WORD: Final = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, both included.

    Attributes
    ----------
    low, high
        Whole numbers for a whole setting.
    step
        Between two neighbours; None for all numbers, or all whole ones.
    log
        Whether numbers are drawn evenly in their logarithm.
    """

    low: float
    high: float
    step: float | None = None
    log: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether only whole numbers are meant."""
        return isinstance(self.low, int)

    @property
    def ends(self) -> tuple[Any, ...]:
        """Values that bound all others."""
        return (self.low, self.high)

    def value(self, stored: Any) -> Any:
        """The value that Optuna stores so."""
        return stored


@dataclass(frozen=True)
class Choices:
    """One of some values.

    Attributes
    ----------
    values
        Numbers, text, true, false, null, or lists of these.
    """

    values: tuple[Any, ...]

    @property
    def ends(self) -> tuple[Any, ...]:
        """All values."""
        return self.values

    @property
    def labels(self) -> dict[Any, Any]:
        """The values by what Optuna stores for them: lists as text."""
        return {
            override_text(value) if isinstance(value, list) else value: value
            for value in self.values
        }

    def value(self, stored: Any) -> Any:
        """The value that Optuna stores so."""
        return self.labels[stored]


Space = Mapping[str, Range | Choices]


def find_space(name: str | None, algo: str) -> Path:
    """The file that describes a search space.

    Parameters
    ----------
    name
        Of a file in `configs/search`, or the path of a YAML file; None takes the one in
        `configs/search` that is named like the algorithm.
    algo
        Name of the algorithm.

    Raises
    ------
    ValueError
        There is no such file.
    """
    folder = configs_folder() / "search"
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    if name is None:
        if algo not in known:
            raise ValueError(
                f"there is no search space for algo={algo} in {folder} (there is {known}): "
                "write one, and name it with --search FILE.yaml"
            )
        return folder / f"{algo}.yaml"
    if name.endswith((".yaml", ".yml")):
        if not Path(name).is_file():
            raise ValueError(f"--search: there is no file {name}")
        return Path(name)
    return folder / f"{one_of('--search', name, known)}.yaml"


def read_space(path: Path) -> dict[str, Any]:
    """What a file with a search space holds.

    Raises
    ------
    ValueError
        It is no YAML mapping, or a key comes twice.
    """
    from omegaconf import DictConfig, OmegaConf  # noqa: PLC0415
    from omegaconf.errors import OmegaConfBaseException  # noqa: PLC0415
    from yaml import YAMLError  # noqa: PLC0415

    try:
        load_yaml(path)  # without aliases, which OmegaConf would multiply
        loaded = OmegaConf.load(path)
    except (YAMLError, OmegaConfBaseException, UnicodeDecodeError, OSError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    if not isinstance(loaded, DictConfig) or not loaded:
        raise ValueError(f"{path} must hold keys and what each may be, got nothing of the kind")
    # unresolved: an interpolation is no number, and is refused as such
    plain: Any = OmegaConf.to_container(loaded, resolve=False)
    return {str(key): value for key, value in plain.items()}


def search_space(written: Mapping[str, Any], settings: Mapping[str, Any], name: str) -> Space:
    """Check what a file says of a search space.

    Parameters
    ----------
    written
        Key -> `{low, high, log, step}` or `{choices}`.
    settings
        Of a training run, nested; a searched key is among them.
    name
        Of the file, for messages.

    Raises
    ------
    ValueError
        A key that there is not or that cannot be searched, or a range without values.
    """
    known = flat(settings)
    space: dict[str, Range | Choices] = {}
    for key, given in written.items():
        where = f"{name}: {key}"
        if key not in known:
            if any(other.startswith(f"{key}.") for other in known):
                raise ValueError(
                    f"{where} is a group; write its keys in full, as {key}.<key>, and search "
                    "each choice of a group in a study of its own"
                )
            raise ValueError(f"{name}: {unknown_key(key, known)}")
        if key in _FIXED:
            raise ValueError(f"{where} cannot be searched: trials would not be comparable")
        if not isinstance(given, Mapping):
            raise ValueError(f"{where} must be {{low, high}} or {{choices}}, got {given!r}")
        if "choices" in given:
            space[key] = _choices(given, where)
        else:
            space[key] = _range(given, known[key], where)
    return space


def _choices(given: Mapping[str, Any], where: str) -> Choices:
    others = [key for key in given if key != "choices"]
    if others:
        raise ValueError(f"{where} has choices, so it takes no {others[0]!r}")
    values = given["choices"]
    if not isinstance(values, list) or len(values) < 2:
        raise ValueError(f"{where}.choices must be a list of two or more, got {values!r}")
    for value in values:
        if not _is_plain(value):
            raise ValueError(f"{where}.choices must be numbers, text or lists, got {value!r}")
    texts = [override_text(value) for value in values]
    double = next((text for text in texts if texts.count(text) > 1), None)
    if double is not None:
        raise ValueError(f"{where}.choices must differ, got {double} twice")
    return Choices(tuple(values))


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(_is_plain(item) for item in value)
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, bool | int | str)


def _range(given: Mapping[str, Any], setting: Any, where: str) -> Range:
    for key in given:
        one_of(f"{where}: a key", key, (*_RANGE, "choices"))
    for key in ("low", "high"):
        if key not in given:
            raise ValueError(f"{where} must have low and high, or choices, got {dict(given)}")
    numbers = {key: given[key] for key in ("low", "high", "step") if given.get(key) is not None}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{where}.{key} must be a number, got {value!r}")
        if not math.isfinite(value):
            raise ValueError(f"{where}.{key} must be finite, got {value!r}")
    log = given.get("log", False)
    if not isinstance(log, bool):
        raise ValueError(f"{where}.log must be true or false, got {log!r}")
    is_whole = all(isinstance(value, int) for value in numbers.values())
    if isinstance(setting, int) and not isinstance(setting, bool) and not is_whole:
        raise ValueError(f"{where} is a whole number, so low, high and step must be, got {numbers}")
    if isinstance(setting, float) or not is_whole:
        numbers = {key: float(value) for key, value in numbers.items()}
    low, high, step = numbers["low"], numbers["high"], numbers.get("step")
    if low >= high:
        raise ValueError(f"{where}.low must be below its high, {high}, got {low}")
    if log and low <= 0:
        raise ValueError(f"{where}.low must be above 0 with log: true, got {low}")
    if step is not None:
        _check_step(low, high, step, log=log, where=where)
    return Range(low, high, step, log)


def _check_step(low: float, high: float, step: float, *, log: bool, where: str) -> None:
    if log:
        raise ValueError(f"{where} takes either log: true or a step, got {step} with log")
    if step <= 0:
        raise ValueError(f"{where}.step must be above 0, got {step}")
    if (Decimal(str(high)) - Decimal(str(low))) % Decimal(str(step)):
        raise ValueError(f"{where}.step must lead from {low} to {high}, got {step}")


def with_values(settings: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested settings with other values at dotted keys."""
    changed = copy.deepcopy(dict(settings))
    for key, value in values.items():
        *groups, last = key.split(".")
        group = changed
        for name in groups:
            group = group[name]
        group[last] = value
    return changed


def check_space(space: Space, check: Callable[[dict[str, Any]], object], name: str) -> None:
    """Raise ValueError if a search could draw what cannot be trained.

    Every end of every range and every choice is tried, and every two of them together; three that
    do not go together, or a number within a range, may still be refused in a trial.

    Parameters
    ----------
    space
        The search space.
    check
        Takes values by key, and raises ValueError if they are not allowed.
    name
        Of the file, for messages.
    """
    first = {key: dimension.ends[0] for key, dimension in space.items()}
    alone = [{key: value} for key, dimension in space.items() for value in dimension.ends]
    pairs = [
        {one: left, other: right}
        for one, other in itertools.combinations(space, 2)
        for left in space[one].ends[1:]
        for right in space[other].ends[1:]
    ]
    for values in alone + pairs:
        try:
            check({**first, **values})
        except ValueError as error:
            given = " ".join(f"{key}={override_text(value)}" for key, value in values.items())
            raise ValueError(f"{name} allows {given}, but {error}") from error


def override_text(value: Any) -> str:
    """A value as it is written on the command line, after the key and `=`."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{','.join(map(override_text, value))}]"
    if isinstance(value, str):
        if _WORD.fullmatch(value) and value.lower() not in {"null", "true", "false", "nan", "inf"}:
            return value
        # in Hydra's grammar, backslashes count only before a quote
        escaped = re.sub(r"(\\*)('|$)", lambda found: found[1] * 2 + "\\'" * len(found[2]), value)
        return f"'{escaped}'"
    return repr(value)


def short_text(value: Any) -> Any:
    """A value as it is shown: with four digits, lists as on the command line."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    return override_text(value) if isinstance(value, list) else value
