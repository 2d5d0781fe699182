"""Python objects of users: by name, `module:attribute`, imported because they named them."""

import importlib
import inspect
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar, cast

T = TypeVar("T")


def is_entry_point(name: str) -> bool:
    """Whether a name is of the form `module:attribute`."""
    module, colon, attribute = name.partition(":")
    parts = module.split(".")
    return bool(colon) and attribute.isidentifier() and all(part.isidentifier() for part in parts)


def is_loaded(name: str) -> bool:
    """Whether the module of an entry point has been imported already."""
    return name.partition(":")[0] in sys.modules


def check_trust(source: Path, settings: Any, is_trusted: bool, how: str) -> None:
    """Let code that a file names run only with the user's consent.

    Parameters
    ----------
    source
        The file or folder, for the message.
    settings
        What it holds: nested mappings and lists.
    is_trusted
        Whether the user has consented on the command line.
    how
        To consent, for the message.

    Raises
    ------
    ValueError
        The settings name modules, or pickles of Stable-Baselines3, and are not trusted.
    """
    if not is_trusted and (code := named_code(settings)):
        raise ValueError(
            f"{source} names code that would be run: {', '.join(code)}. Add {how} if you know who "
            "made it"
        )


def named_code(settings: Any) -> list[str]:
    """Modules, as `module:attribute`, and pickles that settings of any depth name."""
    texts = list(dict.fromkeys(_texts(settings)))
    pickles = [text for text in texts if ":" in text and text.endswith(".zip")]
    return [*filter(is_entry_point, texts), *pickles]


def _texts(settings: Any) -> Iterator[str]:
    """Every text in nested mappings and lists, keys too, and the parts of those like a@b."""
    if isinstance(settings, str):
        yield from dict.fromkeys((settings, *settings.split("@")))
    elif isinstance(settings, Mapping):
        for key, value in settings.items():
            yield from _texts(key)
            yield from _texts(value)
    elif isinstance(settings, list | tuple):
        for value in settings:
            yield from _texts(value)


def load_module(name: str, key: str, example: str) -> dict[str, Any]:
    """Import the module of an entry point.

    It is looked for where Python looks, and after that in the current folder. Importing a module
    runs its code.

    Parameters
    ----------
    name
        `module:attribute`.
    key
        What the user set to it, for messages.
    example
        One that would do, for messages.

    Returns
    -------
    What the module defines, by name.

    Raises
    ------
    ValueError
        The name is not of this form, or there is no such module, or it cannot be imported.
    """
    if not is_entry_point(name):
        raise ValueError(f"{key} must be module:attribute, e.g. {example}, got {name!r}")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    importlib.invalidate_caches()
    module = name.partition(":")[0]
    try:
        return vars(importlib.import_module(module))
    except Exception as error:
        # the module is the user's own code: it may raise anything
        raise ValueError(
            f"{key} is {name!r}, but {module} cannot be imported: {type(error).__name__}: {error}"
        ) from error


def find(key: str, name: str, built_in: Mapping[str, type[T]], base: type[T]) -> type[T]:
    """Find the class that a name in a config stands for; `base` is what it is derived from.

    The other parameters and the errors are those of `look_up`.
    """

    def is_derived(value: object) -> bool:
        return isinstance(value, type) and issubclass(value, base) and value is not base

    return look_up(key, name, built_in, is_derived, base.__name__)


def name_of(settings: object, built_in: Mapping[str, type]) -> str:
    """Name of the class of settings: a built-in one, or `module:attribute`."""
    kind = type(settings)
    names = (name for name, known in built_in.items() if known is kind)
    return next(names, f"{kind.__module__}:{kind.__qualname__}")


def settings_from(
    key: str,
    given: object,
    built_in: Mapping[str, type[T]],
    base: type[T],
    former: Collection[str],
    usual: Mapping[str, T],
) -> T:
    """Settings as they are given, of a name, or of what `dataclasses.asdict` made of them.

    Parameters
    ----------
    key
        What the user set, for messages.
    given
        Settings derived from `base`, the name of their class, or the fields by name; "name" is that
        of the class.
    built_in, base
        See `find`.
    former
        Settings that records of 0.1 hold of every class; where one has them not, they are ignored.
    usual
        Settings by further names, which a record may change.

    Raises
    ------
    ValueError
        If there is no name, or no such class, setting or value.
    """
    from flyrl.validation import known_keys  # noqa: PLC0415 - completion does without NumPy

    if isinstance(given, base):
        return given
    record = {"name": given} if isinstance(given, str) else given
    if not isinstance(record, Mapping):
        raise ValueError(f"{key} must be a {base.__name__} or the name of one, got {given!r}")
    name = record.get("name")
    if not isinstance(name, str):
        raise ValueError(f"{key}.name must be text, got {name!r}")
    own = usual.get(name)
    kinds = {**{each: type(settings) for each, settings in usual.items()}, **built_in}
    kind: Any = find(key if given == name else f"{key}.name", name, kinds, base)
    known = [each.name for each in fields(kind) if each.init]
    settings = {
        each: value
        for each, value in record.items()
        if each != "name" and (each in known or each not in former)
    }
    known_keys(key, settings, known)
    return cast(T, kind(**settings) if own is None else replace(cast(Any, own), **settings))


def look_up(
    key: str, name: str, built_in: Mapping[str, T], fits: Callable[[object], bool], kind: str
) -> T:
    """Find what a name in a config stands for: built in, or the user's own.

    Parameters
    ----------
    key
        What the user set, for messages.
    name
        A built-in name, or `module:attribute`, whose module is imported (see `load_module`).
    built_in
        What there is, by name.
    fits
        Whether an object of the user's module may have such a name.
    kind
        Word for one, for messages.

    Raises
    ------
    ValueError
        If there is nothing of that name, or something that does not fit.
    """
    from flyrl.validation import one_of  # noqa: PLC0415 - completion does without NumPy

    if built_in and not is_entry_point(name):
        return built_in[one_of(key, name, built_in)]
    module, _, attribute = name.partition(":")
    defined = load_module(name, key, "my_lab:MINE")
    known = {each: value for each, value in defined.items() if fits(value)}
    if attribute in defined and attribute not in known:
        given = type(defined[attribute]).__name__
        raise ValueError(f"{key}: {name} must be a {kind}, got a {given}")
    return cast(T, known[one_of(f"{key}, of the {kind}s in {module},", attribute, known)])


def takes(function: Callable[..., Any], count: int) -> bool:
    """Whether a function can be called with so many arguments by position, and no others."""
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        return False
    except ValueError:  # of C's, without a signature
        return count == 1
    return True
