"""What every service has. Importing this, or the services' settings, imports no service."""

import importlib.util
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from flyrl.resources import install_command

DECISIONS_LOGGED: Final = "time/total_timesteps"
"""Stable-Baselines3's name for the decisions so far, in every row but a run's last."""

Outcome = Literal["finished", "interrupted", "failed"]


class LoggerError(OSError):
    """A service cannot be used."""


@dataclass(frozen=True)
class Row:
    """Metrics of one moment.

    Attributes
    ----------
    step
        Decisions so far.
    time_s
        Seconds since 1970.
    values
        Metric -> value.
    """

    step: int
    time_s: float
    values: Mapping[str, float]


@dataclass(frozen=True)
class LocalRun:
    """The run that a service is informed about.

    Attributes
    ----------
    folder
        Its folder, whose name it has at the service too.
    settings
        As `config.training_record` gives them.
    last_step
        The last step in its `progress.csv`; -1 if there is none.
    """

    folder: Path
    settings: Mapping[str, Any]
    last_step: int


class Session(ABC):
    """A run that is open at a service. Every method may raise anything that the service does.

    Attributes
    ----------
    run_id
        The service's name for the run.
    url
        Page of the run, if there is one.
    last_step
        The last step that the service holds of it; -1 if there is none.
    """

    run_id: str
    url: str | None
    last_step: int

    @abstractmethod
    def log(self, row: Row) -> None:
        """Send metrics."""

    @abstractmethod
    def save_files(self, paths: Sequence[Path]) -> None:
        """Send files, to be kept with the run."""

    @abstractmethod
    def finish(self, outcome: Outcome) -> None:
        """Say how the run ended, once everything is sent."""


@dataclass(frozen=True, kw_only=True)
class LoggerConfig(ABC):
    """What the settings of every service have."""

    name: ClassVar[str]
    """Of the choice, of the package that is imported, and of flyrl's extra."""

    def check_installed(self) -> None:
        """Raise ValueError if the service's package is missing."""
        spec = importlib.util.find_spec(self.name)
        # a mere folder of that name, as the services leave some, has no origin
        if spec is None or spec.origin is None:
            raise ValueError(
                f"logger={self.name} needs the package {self.name}: {install_command(self.name)}"
            )

    @abstractmethod
    def open(self, run: LocalRun, run_id: str | None) -> Session:
        """Start a run at the service, or go on with the one that has an id."""
