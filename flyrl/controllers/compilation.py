"""The one way in which flyrl compiles its controllers' and muscles' maths.

A kernel is a Numba function that works in place on float64 arrays, allocates nothing and raises
nothing, so that the same code serves the Python classes and the native control callback. It copies
arrays in loops: `a[:] = b` brings a check of shapes, whose message takes seconds to compile.

Numba caches a compiled function under a stamp of that function's own source file, so a kernel that
calls kernels of other files would keep running their old code after they changed. Kernels are
therefore stamped with all sources of the packages whose kernels other files call.
"""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
from numba.core.ccallback import CFunc

P = ParamSpec("P")
R = TypeVar("R")


KERNEL_FOLDERS: Final = tuple(
    Path(__file__).resolve().parents[1] / package for package in ("controllers", "muscles")
)
"""Packages whose kernels other files call."""


def sources_digest(folders: Sequence[Path]) -> str:
    """SHA-256 over the Python files that lie in some folders, in hexadecimal."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.glob("*.py")):
            digest.update(f"{folder.name}/{path.name}\0".encode() + path.read_bytes())
    return digest.hexdigest()


SOURCES_DIGEST = sources_digest(KERNEL_FOLDERS)
"""Of `KERNEL_FOLDERS`; changes whenever a kernel there may have."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function on its first call, with IEEE division, no GIL, and a disk cache."""
    dispatcher: Any = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    if not _stamp_with_all_sources(dispatcher):
        dispatcher = numba.njit(error_model="numpy", nogil=True)(function)
    return cast(Callable[P, R], dispatcher)


def native_callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorate a function that calls kernels, to compile it at once as a cached C function.

    Like `numba.cfunc(signature, cache=True)`, but compiled anew when any kernel's source changed.
    The signature is a Numba one, e.g. `types.void(types.intp)`.
    """

    def compile_callback(function: Callable[..., Any]) -> Any:
        callback = CFunc(
            function,
            (signature.args, signature.return_type),
            locals={},
            options={"error_model": "numpy"},
        )
        callback.enable_caching()
        if not _stamp_with_all_sources(callback):
            return numba.cfunc(signature, error_model="numpy")(function)
        callback.compile()
        return callback

    return compile_callback


def _stamp_with_all_sources(compiled: Any) -> bool:
    """Tie a cached function to `SOURCES_DIGEST`; False if this Numba keeps its stamps elsewhere.

    Then its cache must not be used: rather slow than stale.
    """
    try:
        index = compiled._cache._cache_file
        index._source_stamp = (index._source_stamp, SOURCES_DIGEST)
    except AttributeError:
        return False
    return True
