"""Installing the native callbacks into this process: compiled once, checked before every step."""

import contextlib
import functools
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import mujoco
from filelock import lock_descriptor
from numba.core.event import Event, Listener, install_listener

from flyrl.controllers.controller import advance_command
from flyrl.muscles.muscle import move_by_muscles
from flyrl.simulation.engine import layout
from flyrl.simulation.native import control_callback, segment_of, sensor_callback

_ONE_AT_A_TIME = threading.Lock()
"""Two threads would each compile a callback, of which the second one's is not the installed one."""

_PLACES: Final = {
    name: (getattr(mujoco, f"get_{name}"), getattr(mujoco, f"set_{name}"))
    for name in ("mjcb_control", "mjcb_sensor", "mjcb_passive", "mjcb_contactfilter")
}
"""Callbacks of MuJoCo that change how a model of flyrl's moves: how to read and to set each. Those
of actuators and of time do not."""


@functools.cache
def _c_functions() -> dict[str, Any]:
    """Compile our callbacks, by place; that MuJoCo writes no log file is settled here too."""
    _keep_out_of_the_users_folder()
    found = layout()
    with compiling():
        control, sensor = control_callback(found), sensor_callback(found)
    return {"mjcb_control": control.ctypes, "mjcb_sensor": sensor.ctypes}


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Let other processes wait, which then find in the cache what this one compiles meanwhile.

    If Numba compiles anything instead of reading its cache, stderr says so, once per process.
    """
    with Path(__file__).open() as file:
        with contextlib.suppress(OSError):  # a file system without locks
            lock_descriptor(file.fileno())
        with install_listener("numba:run_pass", _ANNOUNCEMENT):
            yield


class _Announcement(Listener):
    is_made = False

    def on_start(self, event: Event) -> None:
        if not self.is_made:
            self.is_made = True
            print(
                "flyrl: compiling the controllers once: about 20 s, or minutes on a busy machine",
                file=sys.stderr,
                flush=True,
            )

    def on_end(self, event: Event) -> None:
        pass


_ANNOUNCEMENT: Final = _Announcement()


def cache_folders() -> list[Path]:
    """Folders in which compiled controllers are kept."""
    kernels: tuple[Any, ...] = (advance_command, move_by_muscles, segment_of)
    return sorted({Path(kernel.stats.cache_path) for kernel in kernels})


def install() -> None:
    """Install the callbacks into this process where they are missing.

    Raises
    ------
    RuntimeError
        If somebody else's callback is installed that changes how flyrl's models move.
    """
    with _ONE_AT_A_TIME:
        # looked for before anything is compiled: MuJoCo would call it meanwhile
        ours = _c_functions() if _c_functions.cache_info().currsize else {}
        for name, (get, _) in _PLACES.items():
            present = get()
            if present is not None and present is not ours.get(name):
                raise RuntimeError(
                    f"MuJoCo's {name} is taken by {present!r}, which would change how flyrl's "
                    f"bodies move; remove it with mujoco.set_{name}(None) before they do"
                )
        ours = _c_functions()
        for name, function in ours.items():
            get, put = _PLACES[name]
            if get() is None:
                put(function)


def _keep_out_of_the_users_folder() -> None:
    """Have MuJoCo write its warnings to the console only, unless somebody has set its log."""
    log = mujoco.MjLogConfig.get()
    if log.logto_file and log.logfile == "MUJOCO_LOG.TXT":
        log.logto_file = False
        log.set()
