"""MUJOCO_GL, looked at before MuJoCo does.

With a value that it cannot use, or one whose library is missing, MuJoCo cannot even be imported;
with this, everything but pictures works.
"""

import ctypes.util
import os
import sys
from collections.abc import Callable, MutableMapping
from typing import Final

VARIABLE: Final = "MUJOCO_GL"
OFF: Final = "disable"

_ON: Final = ("", "enable", "enabled", "on", "true", "1", "glfw")
_OFF: Final = (OFF, "disabled", "off", "false", "0")
_OF_SYSTEM: Final = {"linux": ("egl", "osmesa", "glx"), "darwin": ("cgl",), "win32": ("wgl",)}
_LIBRARIES: Final = {"egl": "EGL", "osmesa": "OSMesa"}


def settle_gl(
    environ: MutableMapping[str, str],
    system: str = sys.platform,
    find_library: Callable[[str], str | None] = ctypes.util.find_library,
) -> str | None:
    """Switch MuJoCo's pictures off where its environment variable names what cannot be used.

    Parameters
    ----------
    environ
        The environment; changed in place.
    system
        As in `sys.platform`.
    find_library
        Gives the file of a library, or None.

    Returns
    -------
    What is wrong, in a line; None if nothing is.
    """
    given = environ.get(VARIABLE, "")
    name = given.lower().strip()
    own = _OF_SYSTEM.get(system, ())
    if name in (*_ON, *_OFF):
        return None
    if name not in own:
        allowed = ", ".join(repr(each) for each in ("glfw", *own, OFF))
        wrong = f"{VARIABLE} is {given!r}; it must be one of {allowed}, or not set"
    elif name in _LIBRARIES and find_library(_LIBRARIES[name]) is None:
        wrong = f"{VARIABLE} is {given!r}, but there is no library lib{_LIBRARIES[name]}"
    else:
        return None
    environ[VARIABLE] = OFF
    return f"{wrong}; no pictures can be drawn"


def settle() -> None:
    """Do so for this process, with what is wrong on stderr, unless MuJoCo is there already."""
    if VARIABLE in os.environ and "mujoco" not in sys.modules:
        wrong = settle_gl(os.environ)
        if wrong is not None:
            print(f"warning: {wrong}", file=sys.stderr)
