"""The one way in which flyrl compiles its controllers' and muscles' maths.

A kernel is a Numba function that works in place on float64 arrays, allocates nothing and raises
nothing, so that the same code serves the Python classes and the native control callback. It copies
arrays in loops: `a[:] = b` brings a check of shapes, whose message takes seconds to compile.

Numba caches a compiled function under a stamp of that function's own source file, so a kernel that
calls kernels of other files would keep running their old code after they changed. Kernels are
therefore stamped with all sources of the packages whose kernels other files call.
"""

import functools
import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numba import carray, types  # type: ignore[attr-defined]
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic

from flyrl.validation import did_you_mean

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
"""Digest of `KERNEL_FOLDERS`; changes whenever a kernel there may have."""


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


def pointer_cast(element: types.Type) -> Any:
    """Make a Numba intrinsic that reads an integer address as a pointer to `element`."""

    @intrinsic
    def cast(_typing_context, _address):  # type: ignore[no-untyped-def]
        signature = types.CPointer(element)(types.int64)  # type: ignore[no-untyped-call]

        def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


def record_cast(dtype: np.dtype) -> Any:
    """Make a Numba intrinsic that reads an integer address as a pointer to a record."""
    return pointer_cast(numba.from_dtype(dtype))


as_float64: Final = pointer_cast(types.float64)


def _enter(parameters, state, senses, command, output):  # type: ignore[no-untyped-def]
    """Call a controller's kernel with the records at five addresses.

    The names in capitals are those of `entry_point`'s own copy of this function.
    """
    STEP(  # type: ignore[name-defined] # noqa: F821
        carray(AS_PARAMETERS(parameters), (1,))[0],  # type: ignore[name-defined] # noqa: F821
        carray(AS_STATE(state), (1,))[0],  # type: ignore[name-defined] # noqa: F821
        carray(AS_SENSES(senses), (1,))[0],  # type: ignore[name-defined] # noqa: F821
        carray(as_float64(command), (NUM_COMMANDS,)),  # type: ignore[name-defined] # noqa: F821
        carray(AS_OUTPUT(output), (1,))[0],  # type: ignore[name-defined] # noqa: F821
    )


@functools.cache
def as_kernel(step: Callable[..., None]) -> Any:
    """A controller's kernel, compiled or plain, as a compiled one."""
    return step if isinstance(step, Dispatcher) else kernel(step)


@functools.cache
def entry_point(
    step: Callable[..., None],
    records: tuple[np.dtype, np.dtype, np.dtype, np.dtype],
    num_commands: int,
) -> int:
    """Compile a controller's kernel for the engine, once per process and from the disk's cache.

    Parameters
    ----------
    step
        `step(parameters, state, senses, command, output)`, compiled or plain.
    records
        Types of parameters, state, senses and output.
    num_commands
        Length of the command.

    Returns
    -------
    Address of a C function that takes the addresses of the five.
    """
    compiled = as_kernel(step)
    parameters, state, senses, output = records
    names = {
        "STEP": compiled,
        "AS_PARAMETERS": record_cast(parameters),
        "AS_STATE": record_cast(state),
        "AS_SENSES": record_cast(senses),
        "AS_OUTPUT": record_cast(output),
        "NUM_COMMANDS": num_commands,
    }
    # Numba keys its cache on a function's name, file and code, which all copies share but the name
    identity = hashlib.sha256(repr((records, num_commands)).encode())
    for path in sorted(_source_files(compiled)):
        identity.update(path.encode() + Path(path).read_bytes())
    entry = FunctionType(_enter.__code__, {**globals(), **names})
    entry.__qualname__ = f"{compiled.py_func.__qualname__}_{identity.hexdigest()[:16]}"
    five = types.void(*5 * (types.intp,))
    callback = native_callback(five)(entry)
    _KEPT.append(callback)
    return int(callback.address)


def why_not_compiled(error: Exception, fields: Iterable[str]) -> str:
    """Reason in the message of an error that Numba raised, or that a kernel has another field."""
    if isinstance(error, KeyError):
        (field,) = error.args
        return f"no record that it gets has a field {field!r}{did_you_mean(field, fields)}"
    lines = (line.strip() for line in re.sub(r"\x1b\[\d*m", "", str(error)).splitlines())
    kept = [line for line in lines if line and not line.startswith("Failed in nopython")]
    return " ".join(kept[: 2 if kept[0].endswith(":") else 1]) if kept else repr(error)


_KEPT: Final[list[Any]] = []
"""Compiled entry points, which models know by their address alone."""


def _source_files(function: Any) -> set[str]:
    """Files of a compiled function and of all compiled functions that it calls by name."""
    files: set[str] = set()
    waiting, seen = [function], set()
    while waiting:
        python = waiting.pop().py_func
        if python in seen:
            continue
        seen.add(python)
        files.add(python.__code__.co_filename)
        names = _names(python.__code__)
        called = (python.__globals__.get(name) for name in names)
        waiting += [each for each in called if isinstance(each, Dispatcher)]
    return files


def _names(code: CodeType) -> set[str]:
    nested = (each for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*map(_names, nested))


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
