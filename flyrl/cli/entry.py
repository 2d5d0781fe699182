"""How a command starts: the command line is checked, Hydra composes, plain values are handed on."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from flyrl.cli import sweep
from flyrl.cli.arguments import check_arguments, own_overrides, with_own_things
from flyrl.cli.errors import reported
from flyrl.cli.groups import HYDRA_VERSION, plain_values
from flyrl.cli.program import program
from flyrl.resources import configs_folder

_FULL_ERRORS: Final = "HYDRA_FULL_ERROR"


@dataclass(frozen=True)
class Start:
    """How a job was started.

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
    overrides: tuple[str, ...]
    sweep: Path | None = None
    label: str = ""


def run_command(
    config_name: str,
    run: Callable[[dict[str, Any], Start], Path],
    end_of_sweep: Callable[[Path], None] = lambda folder: None,
    subcommand: Sequence[str] = (),
) -> None:
    """Check the command line against `configs/`, then run on what Hydra composes of both.

    Parameters
    ----------
    config_name
        Name of the primary config.
    run
        Takes plain values, resolved, and returns the folder that it made. Called once per job of a
        sweep, possibly in another process.
    end_of_sweep
        Takes the sweep's folder, once its jobs have ended.
    subcommand
        What stands between the program and its arguments, to repeat the command by.

    Raises
    ------
    SystemExit
        With status 1 after a sweep of which a job failed, 2 for a command line that cannot be
        meant so, 130 after Ctrl-C.
    """
    with reported():
        _run(config_name, run, end_of_sweep, subcommand)


def _run(
    config_name: str,
    run: Callable[[dict[str, Any], Start], Path],
    end_of_sweep: Callable[[Path], None],
    subcommand: Sequence[str],
) -> None:
    command, arguments = (*program(), *subcommand), tuple(sys.argv[1:])
    sys.argv[1:] = with_own_things(arguments)  # where Hydra reads them
    asked = check_arguments(config_name, sys.argv[1:])
    here = Path.cwd()
    titles = sweep.titles(asked.jobs) if asked else {}
    labels = sweep.folder_labels(asked.jobs) if asked else {}

    full_errors = os.environ.get(_FULL_ERRORS)

    def job(config: DictConfig) -> None:
        with _variable(_FULL_ERRORS, full_errors):
            run_job(config)

    def run_job(config: DictConfig) -> None:
        settings = HydraConfig.get()
        overrides = own_overrides(settings.overrides.task)
        if settings.mode is not RunMode.MULTIRUN:
            with reported():
                run(plain_values(config), Start((*command, *arguments), overrides))
            return
        folder = Path(settings.sweep.dir)
        start = Start((*command, *overrides), overrides, folder, labels.get(overrides, ""))
        title = titles.get(overrides, "")

        def run_reported() -> Path:
            with reported():
                return run(plain_values(config), start)

        sweep.run_job(folder, here, overrides, title, run_reported)

    start_hydra = hydra.main(
        version_base=HYDRA_VERSION,
        config_path=str(configs_folder().resolve()),
        config_name=config_name,
    )(job)
    # Hydra raises its own errors then, instead of printing their tracebacks
    with _variable(_FULL_ERRORS, "1"):
        if asked is None:
            start_hydra()
        else:
            sweep.run_sweep(asked, (*command, *arguments), start_hydra, end_of_sweep)


@contextmanager
def _variable(name: str, value: str | None) -> Iterator[None]:
    """Set an environment variable for a while; None unsets it."""
    before = os.environ.pop(name, None)
    if value is not None:
        os.environ[name] = value
    try:
        yield
    finally:
        os.environ.pop(name, None)
        if before is not None:
            os.environ[name] = before
