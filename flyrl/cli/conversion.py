"""From nested mappings, as YAML gives them, to frozen dataclasses."""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeVar, get_args, get_origin

from flyrl.cli.arguments import closest

T = TypeVar("T")


def from_mapping(cls: type[T], mapping: Mapping[str, Any], key: str) -> T:
    """Build a dataclass from a mapping of its fields.

    Parameters
    ----------
    cls
        A dataclass whose fields are numbers, text, literals, tuples or such dataclasses.
    mapping
        Field -> value; a field that is missing takes its default.
    key
        Where the mapping stands in the config, for messages.

    Raises
    ------
    ValueError
        An unknown field, a value of the wrong type, or one that the dataclass refuses.
    """
    hints = typing.get_type_hints(cls)
    fields = {field.name for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in mapping.items():
        if name not in fields:
            raise ValueError(
                f"{key}.{name}: no such key; closest: {key}.{closest(str(name), fields)}"
            )
        values[name] = _value(hints[name], value, f"{key}.{name}")
    return cls(**values)


def whole_number(key: str, value: Any) -> int:
    """The value, if it is an int; else raise ValueError."""
    number: int = _value(int, value, key)
    return number


def _value(hint: Any, value: Any, key: str) -> Any:
    origin = get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        hint = next(option for option in get_args(hint) if option is not types.NoneType)
        return None if value is None else _value(hint, value, key)
    if origin is Literal:
        if value not in get_args(hint):
            allowed = [str(option) for option in get_args(hint)]
            raise ValueError(f"{key}: {value!r}; allowed: {', '.join(allowed)}")
        return value
    if origin is tuple:
        return _tuple(get_args(hint), value, key)
    if dataclasses.is_dataclass(hint) and isinstance(value, Mapping):
        return from_mapping(typing.cast(type, hint), value, key)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if dataclasses.is_dataclass(hint):
        raise ValueError(f"{key}: {value!r}; allowed: a group of keys")
    if not isinstance(value, hint) or (isinstance(value, bool) and hint is not bool):
        raise ValueError(f"{key}: {value!r}; allowed: {_NAMES.get(hint, hint.__name__)}")
    return value


_NAMES = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}


def _tuple(hints: Sequence[Any], value: Any, key: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{key}: {value!r}; allowed: a list")
    if hints[-1] is Ellipsis:
        hints = [hints[0]] * len(value)
    if len(value) != len(hints):
        raise ValueError(f"{key}: {value!r}; allowed: a list of {len(hints)}")
    return tuple(
        _value(hint, item, f"{key}[{i}]")
        for i, (hint, item) in enumerate(zip(hints, value, strict=True))
    )
