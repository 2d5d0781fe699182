"""The one way in which flyrl compiles its controllers' maths.

A kernel is a Numba function that works in place on float64 arrays, allocates nothing and raises
nothing, so that the same code serves the Python classes and the native control callback.

Numba caches a compiled function under a stamp of that function's own source file, so a kernel that
calls kernels of other files would keep running their old code after they changed. Kernels are
therefore stamped with all sources of this package.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def _sources_digest() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


SOURCES_DIGEST = _sources_digest()
"""SHA-256 over all Python files of `flyrl.controllers`; changes whenever a kernel may have."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function on its first call, with IEEE division, no GIL, and a disk cache."""
    dispatcher: Any = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    try:
        index = dispatcher._cache._cache_file
        index._source_stamp = (index._source_stamp, SOURCES_DIGEST)
    except AttributeError:  # a Numba that keeps its stamps elsewhere: rather slow than stale
        dispatcher = numba.njit(error_model="numpy", nogil=True)(function)
    return cast(Callable[P, R], dispatcher)
