"""Checks on arguments: a ValueError says what was given and what is allowed."""

import dataclasses
import difflib
import functools
import inspect
import math
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
T = TypeVar("T")

_LINE_BREAKS: Final = {ord(character): " " for character in "\n\t"}


def float_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int, ...],
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
) -> FloatArray:
    """Return a finite float64 copy of `value`.

    Raises
    ------
    ValueError
        If the shape differs, or an element is not a finite number from `minimum` to `maximum`.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers of shape {shape}, got {value!r:.60}") from None
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got shape {array.shape}")
    for is_wrong, allowed in (
        (~np.isfinite(array), "finite"),
        (array < minimum, f"at least {minimum:g}"),
        (array > maximum, f"at most {maximum:g}"),
    ):
        if is_wrong.any():
            first = tuple(np.argwhere(is_wrong)[0].tolist())
            place = f" at {list(first)}" if first else ""
            raise ValueError(f"{name} must be {allowed}, got {array[first]}{place}")
    return array


def number(
    name: str,
    value: float,
    low: float = -sys.float_info.max,
    high: float = sys.float_info.max,
    kind: str = "be a finite number",
) -> float:
    """Return `value` as a float if it is a number from `low` to `high`, else raise ValueError.

    Parameters
    ----------
    kind
        What the message says that it must.
    """
    if not _is_number(value) or not low <= value <= high:
        raise ValueError(f"{name} must {kind}, got {value!r:.60}")
    return float(value)


def positive(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite number above 0, else raise ValueError."""
    return number(name, value, math.ulp(0.0), kind="be a finite number above 0")


def not_negative(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite number of at least 0, else raise ValueError."""
    return number(name, value, 0.0, kind="be a finite number of at least 0")


def at_least(name: str, value: float, minimum: float) -> float:
    """Return `value` as a float if it is finite and at least `minimum`, else raise ValueError."""
    return number(name, value, minimum, kind=f"be at least {minimum}")


def within(name: str, value: float, low: float, high: float) -> float:
    """Return `value` as a float if it is a number from `low` to `high`, else raise ValueError."""
    return number(name, value, low, high, f"lie within {low} and {high}")


def ordered(name: str, given: tuple[float, float]) -> tuple[float, float]:
    """Return `given` if it is (least, greatest), else raise ValueError."""
    if given[0] > given[1]:
        raise ValueError(f"{name} must be (least, greatest), got {given}")
    return given


def whole_number(name: str, value: int, low: int, high: int) -> int:
    """Return `value` as an int if it is one from `low` to `high`, else raise ValueError."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not low <= value <= high:
        raise ValueError(f"{name} must be a whole number from {low} to {high}, got {value!r}")
    return int(value)


def one_of(name: str, value: T, allowed: Iterable[Any]) -> T:
    """Return `value` if it is among `allowed`, else raise ValueError with the closest match."""
    choices = tuple(allowed)
    if value in choices:
        return value
    hint = did_you_mean(value, choices)
    raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, got {value!r}{hint}")


def file_path(name: str, value: object) -> Path:
    """Return `value` as a path, else raise ValueError; an empty one is not the current folder."""
    if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
        raise ValueError(f"{name} must be the path of a folder or file, got {value!r}")
    return Path(value)


def distinct(name: str, values: Iterable[Any]) -> None:
    """Raise ValueError if one of the `values` is there twice."""
    given = tuple(values)
    for value in given:
        if given.count(value) > 1:
            raise ValueError(f"{name} must not hold {value!r} twice, got {given!r}")


def did_you_mean(given: object, known: Iterable[object]) -> str:
    """End of a message that names the known word closest to a given one; empty if none is close."""
    close = difflib.get_close_matches(str(given), map(str, known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else ""


def known_keys(name: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise ValueError if one of the `given` keys of `name` is not known; say which is closest."""
    allowed = tuple(dict.fromkeys(known))
    for key in given:
        if key not in allowed:
            raise ValueError(
                f"{name} has no {key!r}{did_you_mean(key, allowed)} (allowed: {', '.join(allowed)})"
            )


def plain_record(name: str, value: Any) -> None:
    """Raise ValueError unless `value`, read from a file of JSON or YAML, can be shown and counted.

    That is: mappings, lists, printable text of at most 10,000 characters, finite numbers below
    2**64, true, false and null.

    Parameters
    ----------
    name
        Where it stands, for the message.
    """
    if isinstance(value, Mapping):
        for key, item in value.items():
            plain_record(f"a key of {name}", key)
            plain_record(f"{name}.{key}", item)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            plain_record(f"{name}[{i}]", item)
    elif isinstance(value, str):
        if not value.translate(_LINE_BREAKS).isprintable() or len(value) > 10_000:
            raise ValueError(
                f"{name} must be printable text, at most 10,000 long, got {value!a:.60}"
            )
    elif not (value is None or isinstance(value, bool)) and not (
        _is_number(value) and -(2**64) < value < 2**64  # neither NaN nor an infinity is
    ):
        raise ValueError(f"{name} must be a finite number below 2**64, got {value!r:.60}")


def from_keys(name: str, given: Mapping[str, Any], config: type[T]) -> T:
    """Make a config from the values of its fields; raise ValueError as it and `known_keys` do."""
    known_keys(name, given, [field.name for field in dataclasses.fields(config) if field.init])  # type: ignore[arg-type]
    return config(**given)


def random_seed(seed: int) -> int:
    """Return `seed` if MT19937 takes it (an integer of 0 … 2³² - 1), else raise ValueError."""
    if isinstance(seed, bool) or not isinstance(seed, Integral) or not 0 <= seed < 2**32:
        raise ValueError(f"seed must be an integer from 0 to 2**32 - 1, got {seed!r}")
    return int(seed)


class Within(NamedTuple):
    """Range of a field's numbers, as `Annotated[float, Within(0, 1)]`; see `check_fields`."""

    low: float
    high: float


def check_fields(config: Any, group: str = "") -> None:
    """Check the fields of a dataclass, in its `__post_init__`, against their annotations.

    Numbers must be finite, and within the field's `Within`; literals among their values; tuples of
    their length. Numbers become Python's own, lists and arrays tuples, mappings the configs that
    they are the fields of, so that configs can be hashed, stored as JSON and made from it. Text,
    and classes without a rule of their own here, are compared by type.

    Parameters
    ----------
    config
        A dataclass; fields that take no argument are left alone.
    group
        Key at which it stands in a config, for messages.

    Raises
    ------
    ValueError
        With the field's key, its value, and what is allowed.
    """
    prefix = f"{group}." if group else ""
    cls: Any = type(config)
    for name, hint in _checked_fields(cls):
        value = checked(f"{prefix}{name}", getattr(config, name), hint)
        object.__setattr__(config, name, value)


def checked_arguments(
    function: Callable[..., Any], given: Mapping[str, Any], group: str
) -> dict[str, Any]:
    """Arguments of a function by name, defaults included, checked against its annotations.

    The rules are those of `check_fields`; without an annotation, only lists become tuples.

    Parameters
    ----------
    function
        All its parameters have names.
    given
        Arguments by name.
    group
        Key at which they stand in a config, for messages.

    Raises
    ------
    ValueError
        A name that the function does not have, a value that is not allowed, or none where one is
        needed; with the key, the value, and what is allowed.
    """
    try:
        hints = typing.get_type_hints(function, include_extras=True)
    except NameError as error:
        raise ValueError(
            f"annotations of {getattr(function, '__qualname__', function)} cannot be read: {error}"
        ) from error
    parameters = inspect.signature(function).parameters
    known_keys(group, given, parameters)
    arguments = {}
    for name, parameter in parameters.items():
        key = f"{group}.{name}"
        value = given.get(name, parameter.default)
        if value is inspect.Parameter.empty:
            raise ValueError(f"{key} is missing")
        arguments[name] = checked(key, value, hints[name]) if name in hints else tuples(value)
    return arguments


def tuples(value: Any) -> Any:
    """Return `value` with tuples in place of lists, at any depth."""
    return tuple(map(tuples, value)) if isinstance(value, list | tuple) else value


def plain(value: Any) -> Any:
    """Return `value` with dicts for dataclasses, lists for tuples, as JSON and YAML know them."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = dataclasses.asdict(value)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    return list(map(plain, value)) if isinstance(value, list | tuple) else value


@functools.cache
def _checked_fields(cls: Any) -> list[tuple[str, Any]]:
    hints = typing.get_type_hints(cls, include_extras=True)
    return [(field.name, hints[field.name]) for field in dataclasses.fields(cls) if field.init]


_NUMBERS: typing.Final[Mapping[type, type]] = {int: Integral, float: Real}
_WORDS: typing.Final[Mapping[Any, str]] = {
    int: "a whole number",
    float: "a finite number",
    bool: "True or False",
    str: "text",
}


def checked(  # noqa: PLR0911
    name: str, value: Any, hint: Any, within: Within | None = None
) -> Any:
    """Return `value` as its annotation asks for it, by the rules of `check_fields`.

    Parameters
    ----------
    within
        Range of its numbers; an annotation of `Annotated` brings its own.
    """
    origin, options = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return checked(name, value, options[0], options[1])
    if origin in (typing.Union, types.UnionType):
        if value is None and types.NoneType in options:
            return None
        kinds = tuple(option for option in options if option is not types.NoneType)
        if len(kinds) == 1:
            return checked(name, value, kinds[0], within)
        is_tuple = [get_origin(kind) is tuple for kind in kinds]
        if any(is_tuple):  # a number, or one for each
            chosen = is_tuple.index(isinstance(value, list | tuple | np.ndarray))
            return checked(name, value, kinds[chosen], within)
        return _one_of_kinds(name, value, kinds)
    if origin is Literal:
        return one_of(name, value, options)
    if origin is tuple:
        return _checked_tuple(name, value, options, within)
    if hint in _NUMBERS:
        low, high = within or (-sys.float_info.max, sys.float_info.max)
        is_number = isinstance(value, _NUMBERS[hint]) and not isinstance(value, bool)
        if not is_number or not low <= value <= high:
            allowed = f" from {low:g} to {high:g}" if within else ""
            raise ValueError(f"{name} must be {_WORDS[hint]}{allowed}, got {value!r}")
        return hint(value)
    if dataclasses.is_dataclass(hint) and isinstance(value, Mapping):
        return from_keys(name, value, typing.cast(type, hint))
    return _one_of_kinds(name, value, (hint,))


def _one_of_kinds(name: str, value: Any, hints: tuple[Any, ...]) -> Any:
    kinds = tuple(get_origin(hint) or hint for hint in hints)
    if Any not in kinds and not isinstance(value, kinds):
        words = " or ".join(_WORDS.get(kind, f"a {kind.__name__}") for kind in kinds)
        raise ValueError(f"{name} must be {words}, got {value!r}")
    return value


def _checked_tuple(
    name: str, value: Any, hints: tuple[Any, ...], within: Within | None
) -> tuple[Any, ...]:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple):
        raise ValueError(f"{name} must be a list, got {value!r}")
    if hints[-1] is Ellipsis:
        hints = hints[:1] * len(value)
    if len(value) != len(hints):
        raise ValueError(f"{name} must be a list of {len(hints)}, got {value!r}")
    return tuple(
        checked(f"{name}[{i}]", item, hint, within)
        for i, (item, hint) in enumerate(zip(value, hints, strict=True))
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
