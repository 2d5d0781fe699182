"""Many jobs of one command: each leaves a note of how it ended, and one failing stops no other.

The folder of a sweep holds

- `sweep.json`: the command, and the overrides of every job;
- `jobs/`: a JSON note per job that ended: its folder, or its error;
- the run folders;
- `comparison.csv` and `learning_curves.svg` and `.png`, once it has ended.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Final, NoReturn, TypeGuard

from flyrl.cli.arguments import Sweep
from flyrl.cli.errors import Failure
from flyrl.files import new_folder, usable_folder, write_text
from flyrl.text import printable

SWEEP_FILE: Final = "sweep.json"
_NOTES: Final = "jobs"
_IN_NAMES: Final = ("task", "terrain", "algo", "seed")
_MAX_LABEL: Final = 80
_LOOK_S: Final = 1.0
_PARENT: Final = "FLYRL_SWEEP_PROCESS"
_ESCAPED: Final = re.compile(r"\\([\\()\[\]{}:=, \t])")

Job = tuple[str, ...]


class Interrupted(SystemExit):
    """A job that was asked to end before it was done.

    Attributes
    ----------
    folder
        What it had made by then.
    """

    def __init__(self, folder: Path, signal: int) -> None:
        super().__init__(128 + signal)
        self.folder = folder


@dataclass(frozen=True)
class Note:
    """How a job ended.

    Attributes
    ----------
    overrides
        What it was asked for.
    folder
        Name of the folder that it made, in the sweep's folder or as a path; None if it made none.
    error
        None if it succeeded.
    """

    overrides: Job
    folder: str | None
    error: str | None


def by_key(job: Job) -> dict[str, str]:
    """Overrides of a job as key and value, without the backslashes that Hydra escapes with."""
    pairs = (item.partition("=") for item in job)
    return {key.lstrip("+"): _ESCAPED.sub(r"\1", value) for key, _, value in pairs}


def swept_keys(jobs: Sequence[Job]) -> list[str]:
    """Keys whose value differs between jobs."""
    settings = [by_key(job) for job in jobs]
    keys = dict.fromkeys(key for setting in settings for key in setting)
    return [key for key in keys if len({setting.get(key) for setting in settings}) > 1]


def titles(jobs: Sequence[Job]) -> dict[Job, str]:
    """A line for each job: which it is, and what sets it apart from the others."""
    keys = swept_keys(jobs)
    titles = {}
    for number, job in enumerate(jobs, start=1):
        apart = " ".join(f"{key}={value}" for key, value in by_key(job).items() if key in keys)
        titles[job] = f"job {number} of {len(jobs)}" + (f": {apart}" if apart else "")
    return titles


def folder_labels(jobs: Sequence[Job]) -> dict[Job, str]:
    """Swept values of each job, to end the name of its folder: short, and safe everywhere.

    Without those that stand in the name of every run folder anyway.
    """
    keys = [key for key in swept_keys(jobs) if key not in _IN_NAMES]
    labels = {}
    for job in jobs:
        settings = by_key(job)
        words = [
            f"{key.rpartition('.')[2]}-{settings[key].strip('[]{}()')}"
            for key in keys
            if key in settings
        ]
        text = re.sub(r"[^A-Za-z0-9_.+-]+", "-", "_".join(words))
        labels[job] = text[:_MAX_LABEL].strip("-._")
    return labels


def run_job(folder: Path, here: Path, overrides: Job, title: str, job: Callable[[], Path]) -> None:
    """Run a job of a sweep and note how it ended; an error is printed and noted, not raised.

    Parameters
    ----------
    folder
        Of the sweep.
    here
        The folder that the command was started in, which a remote process may not be in.
    overrides
        What the job was asked for.
    title
        A line to print.
    job
        Returns the folder that it made.

    Raises
    ------
    SystemExit
        The job was interrupted in the process of the command itself: the sweep ends too.
    """
    with contextlib.chdir(here):
        print(title, file=sys.stderr)
        try:
            made = job()
        except Failure as failure:
            _write_note(folder, Note(overrides, None, failure.message))
        except Interrupted as interrupted:
            name = _name(interrupted.folder, folder)
            _write_note(folder, Note(overrides, name, "interrupted"))
            if os.environ.get(_PARENT) == str(os.getpid()):
                raise
        except Exception as error:
            traceback.print_exc()
            text = f"{type(error).__name__}: {error}"
            _write_note(folder, Note(overrides, None, text))
        else:
            _write_note(folder, Note(overrides, _name(made, folder), None))


def _name(made: Path, folder: Path) -> str:
    return str(made.relative_to(folder)) if made.is_relative_to(folder) else str(made.resolve())


def _note_path(folder: Path, job: Job) -> Path:
    digest = hashlib.sha256(json.dumps(job).encode()).hexdigest()
    return folder / _NOTES / f"{digest[:16]}.json"


def _write_note(folder: Path, note: Note) -> None:
    path = _note_path(folder, note.overrides)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(asdict(note), indent=2) + "\n")
    except OSError as error:  # the job counts as one that has not ended; the others go on
        print(f"error: {error}", file=sys.stderr)


def read_jobs(folder: Path) -> list[tuple[Job, Note | None]]:
    """Every job of the sweep in a folder, with the note of how it ended, if it did.

    Raises
    ------
    ValueError
        There is no sweep in the folder.
    """
    _, jobs = _read_sweep(folder)
    return [(job, _read_note(folder, job)) for job in jobs]


def _read_sweep(folder: Path) -> tuple[list[str], list[Job]]:
    """Commands and jobs of the sweep in a folder."""
    file = folder / SWEEP_FILE
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{folder} is not the folder of a sweep: {error}") from error
    record = record if isinstance(record, dict) else {}
    commands, jobs = record.get("commands"), record.get("jobs")
    if not _are_texts(commands):
        raise ValueError(f"{file}: 'commands' must be a list of texts, got {commands!r:.60}")
    if not isinstance(jobs, list) or not jobs or not all(map(_are_texts, jobs)):
        raise ValueError(f"{file}: 'jobs' must be a list of lists of texts, got {jobs!r:.60}")
    return commands, [tuple(job) for job in jobs]


def _are_texts(values: Any) -> TypeGuard[list[str]]:
    return isinstance(values, list) and all(isinstance(value, str) for value in values)


def _read_note(folder: Path, job: Job) -> Note | None:
    try:
        record = json.loads(_note_path(folder, job).read_text())
        name, error = record["folder"], record["error"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if not (isinstance(name, str | None) and isinstance(error, str | None)):
        return None
    return Note(job, name, error)


def run_sweep(
    asked: Sweep,
    command: Sequence[str],
    start: Callable[[], object],
    at_end: Callable[[Path], None],
) -> None:
    """Run a sweep to its end, whatever becomes of its jobs, and exit with what came of it.

    Parameters
    ----------
    asked
        What the command line asks for. A folder that it names may hold an earlier sweep, which
        then grows by these jobs.
    command
        Program and arguments.
    start
        Runs the jobs.
    at_end
        Takes the folder.

    Raises
    ------
    SystemExit
        A job failed (1), or the sweep was interrupted (128 + the signal's number).
    OSError, ValueError
        Its folder cannot be used.
    """
    folder = asked.folder
    if asked.is_named:
        usable_folder(folder)
    else:
        folder = new_folder(folder.parent, folder.name)
        place = "hydra.sweep.dir='{}'".format(str(folder).replace("'", r"\'"))
        words = [i for i, text in enumerate(sys.argv) if i and "=" in text and text[0] != "-"]
        # beside the others: Hydra takes no overrides on both sides of an option
        sys.argv.insert(words[0] if words else len(sys.argv), place)
    _announce(folder, asked.jobs, command)
    os.environ[_PARENT] = str(os.getpid())
    code: int | str | None = 0
    stopped_by: int = signal.SIGINT

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        nonlocal stopped_by
        stopped_by = number
        raise KeyboardInterrupt  # of all that a handler can raise, Ray hands on this alone

    try:
        if asked.is_elsewhere:
            # else the process would end, and leave those of the jobs to themselves
            signal.signal(signal.SIGTERM, stop)
        with _progress(folder, asked.jobs, is_shown=asked.is_elsewhere):
            start()
    except KeyboardInterrupt:
        code = 128 + stopped_by
    except SystemExit as error:
        code = error.code
    try:
        at_end(folder)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        code = code or 2
    ended = [_read_note(folder, job) for job in asked.jobs]
    failures = _tell_failures(asked.jobs, ended)
    if failures:
        print(
            f"go on with what is missing: the same command with hydra.sweep.dir={folder}",
            file=sys.stderr,
        )
    print(f"sweep: {folder}")
    sys.exit(code or int(failures > 0))


def _announce(folder: Path, jobs: Sequence[Job], command: Sequence[str]) -> None:
    """Write down what the sweep is to do, after what an earlier one in its folder did."""
    commands: list[str] = []
    known: list[Job] = []
    if (folder / SWEEP_FILE).exists():
        commands, known = _read_sweep(folder)
    for job in jobs:
        _note_path(folder, job).unlink(missing_ok=True)
    record = {
        "commands": [*commands, shlex.join(command)],
        "jobs": list(dict.fromkeys([*known, *jobs])),
    }
    write_text(folder / SWEEP_FILE, json.dumps(record, indent=2) + "\n")


def _tell_failures(jobs: Sequence[Job], ended: Sequence[Note | None]) -> int:
    """Print what did not succeed; return how many."""
    failures, title = 0, titles(jobs)
    for job, note in zip(jobs, ended, strict=True):
        error = "not started, killed, or still running" if note is None else note.error
        if error is not None:
            failures += 1
            print(printable(f"failed: {title[job]}: {error}"), file=sys.stderr)
    return failures


@contextlib.contextmanager
def _progress(folder: Path, jobs: Sequence[Job], *, is_shown: bool) -> Iterator[None]:
    """Draw how many jobs have ended, as their notes tell."""
    stop = threading.Event()
    from flyrl.progress import progress_bar  # noqa: PLC0415

    with progress_bar(len(jobs), is_shown=is_shown, unit=" jobs") as bar:

        def look() -> None:
            while True:
                is_last = stop.wait(_LOOK_S)
                ended = sum(_note_path(folder, job).exists() for job in jobs)
                if ended > bar.n:
                    bar.update(ended - bar.n)
                if is_last:
                    return

        thread = threading.Thread(target=look, daemon=True)
        if is_shown:
            thread.start()
        try:
            yield
        finally:
            stop.set()
            if is_shown:
                thread.join()
