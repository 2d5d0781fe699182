"""The terminal: what is typed there, tables, and errors as messages and exit statuses."""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from flyrl.text import printable

if TYPE_CHECKING:
    import pandas as pd

LEFT_OUT: Final = 1
"""Exit status: done, but something was left out, failed or differs: the command says what."""

UNUSABLE: Final = 2
"""Exit status: the command line, or a file that it names, cannot be used."""

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
        After Ctrl-C, or a signal that raised KeyboardInterrupt with its number; or if whoever
        reads the output wants no more of it.
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
        except KeyboardInterrupt as stop:
            print("interrupted", file=sys.stderr)
            raise Ended(128 + (stop.args[0] if stop.args else signal.SIGINT)) from None
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


class Subparsers(Protocol):
    """Result of `ArgumentParser.add_subparsers`."""

    def add_parser(self, name: str, **settings: Any) -> argparse.ArgumentParser:
        """Parser of a new subcommand."""
        ...


def program() -> tuple[str, ...]:
    """Interpreter and program, without arguments."""
    script = Path(sys.argv[0])
    if script.name == "__main__.py":  # as python -m: the file by itself would not find its package
        return (sys.executable, "-m", script.parent.name)
    return (sys.executable, sys.argv[0])


def path_argument(text: str) -> Path:
    """Path on a command line; an empty one, as of an unset variable, is no path."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the path is empty")
    return Path(text)


def settings_argument(text: str) -> Any:
    """A name on a command line, or settings in braces as YAML has them: {name: cpg, gait: wave}."""
    if not text.startswith("{"):
        return text
    import yaml  # noqa: PLC0415 - for completion it is too slow

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise argparse.ArgumentTypeError(f"{text} is no YAML") from error


def print_table(table: pd.DataFrame) -> None:
    """Print rows under the heads of their columns; nothing as a dash.

    On a terminal that is too narrow, the columns come in several blocks. What a stranger's file
    holds cannot move the cursor or colour the terminal.
    """
    cells = table.map(_text, na_action="ignore").fillna("-").rename(columns=_text)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print(cells.to_string(index=False, line_width=width))


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))
