"""Errors of the user's: the one place where an exception becomes a message and an exit status."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from flyrl.text import printable

LEFT_OUT: Final = 1
"""Exit status: done, but something was left out, failed or differs: the command says what."""

UNUSABLE: Final = 2
"""Exit status: the command line, or a file that it names, cannot be used."""

INTERRUPTED: Final = 128 + signal.SIGINT
"""Exit status after Ctrl-C, as shells have it."""

PIPE_CLOSED: Final = 128 + 13  # SIGPIPE, which Windows has not
"""Exit status where the reader of the output wants no more of it, as `head`."""

_PARSERS = {"antlr4", "hydra", "omegaconf"}
"""Packages whose errors are about the command line or a config file."""


class Ended(SystemExit):
    """The end of a command before it was done; all that there is to say has been printed."""


class Failure(Ended):
    """The end of a command that cannot do what it was asked to.

    Attributes
    ----------
    message
        Printed already.
    """

    def __init__(self, message: str) -> None:
        super().__init__(UNUSABLE)
        self.message = message


@contextmanager
def reported() -> Iterator[None]:
    """End the program with a message where the user can mend an error, without a traceback.

    That is: a ValueError (settings, contents of files), an OSError (files, a full disk), what Hydra
    and OmegaConf raise, values that are nested without end, and sizes beyond the memory. Other
    exceptions are bugs of flyrl's and pass. With the environment variable HYDRA_FULL_ERROR all of
    them do.

    Raises
    ------
    Failure
        After such an error, with status 2.
    Ended
        After Ctrl-C, or if whoever reads the output wants no more of it.
    """
    with _open_streams(), _plain_warnings():
        try:
            try:
                yield
            except SystemExit:
                sys.stdout.flush()  # an error shows here, where it can be reported
                raise
            sys.stdout.flush()
        except BrokenPipeError:
            _drop_output()
            raise Ended(PIPE_CLOSED) from None
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            raise Ended(INTERRUPTED) from None
        except Exception as error:
            if os.environ.get("HYDRA_FULL_ERROR") or not _is_users(error):
                raise
            _drop_output()
            message = str(error).partition("\nSee http")[0]
            if isinstance(error, RecursionError):
                message = "a value is nested too deeply"
            elif isinstance(error, MemoryError):
                message = f"there is not enough memory for these sizes. {message}".strip()
            message = printable(message, keep="\n\t")  # it may quote a file of somebody else's
            print(f"error: {message}", file=sys.stderr)
            raise Failure(message) from None


def _is_users(error: Exception) -> bool:
    if isinstance(error, ValueError | OSError | RecursionError | MemoryError):
        return True
    return any(cls.__module__.partition(".")[0] in _PARSERS for cls in type(error).__mro__)


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Print warnings as a line without the place in the code, each once."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        yield


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"warning: {printable(str(message))}", file=sys.stderr)


@contextmanager
def _open_streams() -> Iterator[None]:
    """Let output that was closed (>&-) go nowhere, not into the file that is opened next."""
    with Path(os.devnull).open("w") as nowhere:
        closed = [name for name in ("stdout", "stderr") if getattr(sys, name) is None]
        for name in closed:
            setattr(sys, name, nowhere)
        try:
            yield
        finally:
            for name in closed:
                setattr(sys, name, None)


def _drop_output() -> None:
    """Let what cannot be written to stdout go nowhere, instead of to an error at the end."""
    with suppress(ValueError):  # closed
        try:
            sys.stdout.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)
