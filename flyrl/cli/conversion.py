"""From nested mappings, as YAML gives them, to frozen dataclasses."""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, Literal, TypeVar, cast, get_args, get_origin

from flyrl.cli.arguments import unknown_key
from flyrl.validation import one_of

T = TypeVar("T")


def group(config: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Copy of the group of keys at `key` of a config; ValueError if there is none."""
    found = config.get(key)
    if not isinstance(found, Mapping):
        raise ValueError(f"{key} must be a group of keys, got {found!r:.60}")
    return dict(found)


def from_mapping(cls: type[T], mapping: Mapping[str, Any], key: str) -> T:
    """Build a dataclass from a mapping of its fields.

    Parameters
    ----------
    cls
        A dataclass whose fields are numbers, text, literals, tuples, dicts by text, or such
        dataclasses.
    mapping
        Field -> value; a field that is missing takes its default.
    key
        Where the mapping stands in the config, for messages; empty at the top.

    Raises
    ------
    ValueError
        An unknown field, a value of the wrong type, or one that the dataclass refuses.
    """
    if not isinstance(mapping, Mapping):
        raise ValueError(f"{key} must be a group of keys, got {mapping!r:.60}")
    hints = typing.get_type_hints(cls)
    prefix = f"{key}." if key else ""
    fields = {field.name for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in mapping.items():
        if name not in fields:
            raise unknown_key(f"{prefix}{name}", [f"{prefix}{field}" for field in fields])
        values[name] = _value(hints[name], value, f"{prefix}{name}")
    return cls(**values)


def whole_number(key: str, value: Any) -> int:
    """The value, if it is an int; else raise ValueError."""
    number: int = _scalar(int, value, key)
    return number


def _value(hint: Any, value: Any, key: str) -> Any:
    origin, options = get_origin(hint), get_args(hint)
    if origin in (typing.Union, types.UnionType):
        given = next(option for option in options if option is not types.NoneType)
        return None if value is None else _value(given, value, key)
    if origin is Literal:
        return one_of(key, value, options)
    if origin is tuple:
        return _tuple(options, value, key)
    if origin is dict:
        if not isinstance(value, Mapping):
            raise ValueError(f"{key} must be a group of keys, got {value!r}")
        return {name: _value(options[1], item, f"{key}.{name}") for name, item in value.items()}
    if dataclasses.is_dataclass(hint):
        return from_mapping(cast(type, hint), value, key)
    return value if hint is Any else _scalar(hint, value, key)


_NAMES: Final = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}


def _scalar(hint: type, value: Any, key: str) -> Any:
    if hint is float and type(value) is int:
        with suppress(OverflowError):
            return float(value)
    if type(value) is not hint:
        raise ValueError(f"{key} must be {_NAMES[hint]}, got {value!r:.60}")
    return value


def _tuple(hints: Sequence[Any], value: Any, key: str) -> tuple[Any, ...]:
    is_open = hints[-1] is Ellipsis
    if is_open and isinstance(value, str | int | float):
        value = [value]  # one value stands for a list of one
    if not isinstance(value, list | tuple):
        raise ValueError(f"{key} must be a list, got {value!r}")
    if is_open:
        hints = [hints[0]] * len(value)
    if len(value) != len(hints):
        raise ValueError(f"{key} must be a list of {len(hints)}, got {value!r}")
    return tuple(
        _value(hint, item, f"{key}[{i}]")
        for i, (hint, item) in enumerate(zip(hints, value, strict=True))
    )
