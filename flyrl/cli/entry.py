"""From a command line to jobs: it is checked, Hydra composes, plain values are handed on.

The folder of a sweep holds the run folders; `comparison.csv` and the learning curves, once it has
ended; Hydra's `multirun.yaml`; and in `jobs/` a file per job that ended, with its error, if any.
"""

import contextlib
import hashlib
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Final, NoReturn, cast

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from flyrl.cli.arguments import (
    HYDRA_VERSION,
    Sweep,
    by_present_name,
    check_arguments,
    own_overrides,
)
from flyrl.cli.terminal import Failure, program, reported
from flyrl.files import new_folder, usable_folder, write_text
from flyrl.resources import configs_folder
from flyrl.text import printable

_FULL_ERRORS: Final = "HYDRA_FULL_ERROR"
_IN_NAMES: Final = ("task", "terrain", "algo", "seed")
"""Keys whose values stand in the name of every run folder."""
_MAX_LABEL: Final = 80
_ESCAPED: Final = re.compile(r"\\([\\()\[\]{}:=, \t])")

Job = tuple[str, ...]


@dataclass(frozen=True)
class Start:
    """Start of a job: command, overrides and sweep.

    Attributes
    ----------
    command
        Program and arguments that repeat it; of a job of a sweep, without its siblings.
    overrides
        Those on the command line, without Hydra's own.
    sweep
        Folder of the sweep that it is part of, or None.
    label
        End of the name of a folder that it makes: the swept values.
    """

    command: tuple[str, ...]
    overrides: Job
    sweep: Path | None = None
    label: str = ""


def run_command(
    config_name: str,
    run: Callable[[dict[str, Any], Start], None],
    end_of_sweep: Callable[[Path], None] = lambda folder: None,
    subcommand: Sequence[str] = (),
) -> None:
    """Check the command line against `configs/`, then run on what Hydra composes of both.

    Parameters
    ----------
    config_name
        Name of the primary config.
    run
        Takes plain values, resolved. Called once per job of a sweep, possibly in another process.
    end_of_sweep
        Takes the sweep's folder, once its jobs have ended.
    subcommand
        What stands between the program and its arguments, to repeat the command by.

    Raises
    ------
    SystemExit
        With status 1 after a sweep of which a job failed, 2 for an invalid command line, 128 + the
        signal's number after Ctrl-C or SIGTERM.
    """
    with reported(), _sigterm_as_ctrl_c() as stopped_by:
        command, arguments = (*program(), *subcommand), tuple(sys.argv[1:])
        sys.argv[1:] = map(by_present_name, arguments)  # where Hydra reads them
        asked = check_arguments(config_name, sys.argv[1:])
        names = job_names(asked.jobs if isinstance(asked, Sweep) else ())
        here, process = Path.cwd(), os.getpid()

        def job(config: DictConfig) -> None:
            settings = HydraConfig.get()
            overrides = own_overrides(settings.overrides.task)
            title, label = names.get(overrides, ("", ""))
            start = Start((*command, *arguments), overrides)
            if settings.mode is RunMode.MULTIRUN:
                start = Start((*command, *overrides), overrides, Path(settings.sweep.dir), label)

            def run_here() -> None:
                values = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
                run(cast(dict[str, Any], values), start)

            with contextlib.chdir(here):  # of a job in another process, it may be another
                if start.sweep is None:
                    run_here()
                else:
                    print(title, file=sys.stderr)
                    note = note_of(start.sweep, overrides)
                    run_job(note, run_here, is_here=os.getpid() == process)

        start_hydra = hydra.main(
            version_base=HYDRA_VERSION,
            config_path=str(configs_folder().resolve()),
            config_name=config_name,
        )(job)
        if isinstance(asked, Sweep):
            _run_sweep(asked, start_hydra, end_of_sweep, stopped_by)
        elif asked is None:
            with _raised_errors():
                start_hydra()
        else:  # Hydra would compose it twice more
            HydraConfig.instance().set_config(asked)
            job(OmegaConf.masked_copy(asked, [str(key) for key in asked if key != "hydra"]))


@contextlib.contextmanager
def _sigterm_as_ctrl_c() -> Iterator[list[int]]:
    """Let SIGTERM raise KeyboardInterrupt with its number, which goes into the list, too.

    Of all that a handler can raise, Ray hands on this alone, without the number.
    """
    numbers: list[int] = []

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        numbers.append(number)
        raise KeyboardInterrupt(number)

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield numbers
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def _raised_errors() -> Iterator[None]:
    """Let Hydra raise errors, for `reported`, instead of printing their tracebacks."""
    is_set = _FULL_ERRORS in os.environ
    os.environ.setdefault(_FULL_ERRORS, "1")
    try:
        yield
    finally:
        if not is_set:
            del os.environ[_FULL_ERRORS]


def by_key(job: Job) -> dict[str, str]:
    """Overrides of a job as key and value, without the backslashes that Hydra escapes with."""
    pairs = (item.partition("=") for item in job)
    return {key.lstrip("+"): _ESCAPED.sub(r"\1", value) for key, _, value in pairs}


def job_names(jobs: Sequence[Job]) -> dict[Job, tuple[str, str]]:
    """Title of each job, and a label that ends the name of its folder, of its swept values.

    The label is short, safe everywhere, and without what is in the name of every run folder.
    """
    settings = [by_key(job) for job in jobs]
    keys = dict.fromkeys(key for each in settings for key in each)
    swept = [key for key in keys if len({each.get(key) for each in settings}) > 1]
    names = {}
    for number, (job, each) in enumerate(zip(jobs, settings, strict=True), start=1):
        apart = {key: value for key, value in each.items() if key in swept}
        title = " ".join(f"{key}={value}" for key, value in apart.items())
        words = [
            f"{key.rpartition('.')[2]}-{value.strip('[]{}()')}"
            for key, value in apart.items()
            if key not in _IN_NAMES
        ]
        label = re.sub(r"[^A-Za-z0-9_.+-]+", "-", "_".join(words))[:_MAX_LABEL].strip("-._")
        names[job] = (f"job {number} of {len(jobs)}" + (f": {title}" if title else ""), label)
    return names


def note_of(folder: Path, job: Job) -> Path:
    """File in a sweep's folder that says how a job ended: its error, or nothing."""
    return folder / "jobs" / f"{hashlib.sha256(' '.join(job).encode()).hexdigest()[:16]}.txt"


def run_job(note: Path, job: Callable[[], object], *, is_here: bool) -> None:
    """Run a job of a sweep and note how it ended; an error is printed and noted, not raised.

    Parameters
    ----------
    note
        See `note_of`.
    job
        The job.
    is_here
        Whether this is the process of the command, so that an interruption ends the sweep.

    Raises
    ------
    SystemExit
        The job was interrupted, here.
    """
    error, end = "", None
    try:
        with reported():
            job()
    except Failure as failure:
        error = failure.message
    except SystemExit as interruption:
        error, end = "interrupted", interruption
    except Exception as bug:
        traceback.print_exc()
        error = f"{type(bug).__name__}: {bug}"
    try:
        note.parent.mkdir(parents=True, exist_ok=True)
        write_text(note, error)
    except OSError as unwritten:  # the job counts as one that has not ended; the others go on
        print(f"error: {unwritten}", file=sys.stderr)
    if end is not None and is_here:
        raise end


def _run_sweep(
    asked: Sweep,
    start: Callable[[], object],
    at_end: Callable[[Path], None],
    stopped_by: Sequence[int],
) -> NoReturn:
    """Run a sweep to its end, whatever becomes of its jobs, and exit with what came of it.

    Parameters
    ----------
    asked
        What the command line asks for. A folder that it names may hold an earlier sweep, which
        then grows by these jobs.
    start
        Runs the jobs.
    at_end
        Takes the folder.
    stopped_by
        Numbers of the signals that came.

    Raises
    ------
    SystemExit
        A job failed (1), or the sweep was interrupted (128 + the signal's number).
    OSError
        Its folder cannot be used.
    """
    folder = asked.folder
    if any(word.startswith("hydra.sweep.dir=") for word in sys.argv):
        usable_folder(folder)
    else:
        folder = new_folder(folder.parent, folder.name)
        place = "hydra.sweep.dir='{}'".format(str(folder).replace("'", r"\'"))
        # beside the others: Hydra takes no overrides on both sides of an option
        is_option = [word.startswith("-") or "=" not in word for word in sys.argv]
        sys.argv.insert([*is_option, False].index(False), place)
    notes = {note_of(folder, job): title for job, (title, _) in job_names(asked.jobs).items()}
    for note in notes:
        note.unlink(missing_ok=True)
    code: int | str | None = 0
    try:
        start()
    except KeyboardInterrupt:
        code = 128 + (stopped_by[-1] if stopped_by else signal.SIGINT)
    except SystemExit as error:
        code = error.code
    try:
        at_end(folder)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        code = code or 2
    failures = 0
    for note, title in notes.items():
        ending = note.read_text() if note.exists() else "not started, killed, or still running"
        if ending:
            failures += 1
            print(printable(f"failed: {title}: {ending}"), file=sys.stderr)
    if failures:
        print(
            f"resume what is missing: the same command with hydra.sweep.dir={folder}",
            file=sys.stderr,
        )
    print(f"sweep: {folder}")
    sys.exit(code or int(failures > 0))
