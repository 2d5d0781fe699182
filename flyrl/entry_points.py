"""Python objects by name, `module:attribute`, imported because the user named them."""

import importlib
import sys
from pathlib import Path
from typing import Any


def is_entry_point(name: str) -> bool:
    """Whether a name is of the form `module:attribute`."""
    module, colon, attribute = name.partition(":")
    parts = module.split(".")
    return bool(colon) and attribute.isidentifier() and all(part.isidentifier() for part in parts)


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
