"""Metrics on their way to a service, which may be out of reach for a while."""

import json
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, Final

from stable_baselines3.common.logger import KVWriter, filter_excluded_keys
from tqdm import tqdm

from flyrl.training.loggers.base import (
    DECISIONS_LOGGED,
    LocalRun,
    LoggerConfig,
    LoggerError,
    Outcome,
    Row,
    Session,
)
from flyrl.training.run_folder import RunFolder
from flyrl.training.runs import read_rows

FILE: Final = "logger.json"
_RETRY_AFTER_S: Final = 60.0
_SHARE_OF_TIME: Final = 0.1
"""Of the training's, at most, that goes into waiting for a service out of reach."""


class RemoteLog(KVWriter):
    """Sends the scalars that are logged to a service, and never raises while it does.

    What does not arrive waits for the next try. Of a run that goes on, what the service holds
    already is not sent again.

    Parameters
    ----------
    config
        Which service.
    folder
        Of the run; `logger.json` in it holds the service's id of the run.
    settings
        As `config.training_record` gives them.
    """

    def __init__(
        self, config: LoggerConfig, folder: RunFolder, settings: Mapping[str, Any]
    ) -> None:
        self._config = config
        self._folder = folder
        rows = read_rows(folder.path / "progress.csv")
        steps = [row.get(DECISIONS_LOGGED) or "" for row in rows]
        last_step = max((int(step) for step in steps if step.isdigit()), default=-1)
        self._run = LocalRun(folder.path, settings, last_step)
        self._session: Session | None = None
        self._waiting: deque[Row] = deque()
        self._retry_at_s = 0.0
        self._has_warned = False

    def connect(self) -> None:
        """Open the run at the service now, instead of with the first metrics.

        Raises
        ------
        LoggerError
            That fails.
        """
        try:
            self._open()
        except Exception as error:
            raise LoggerError(f"logger={self._config.name}: {_said(error)}") from error

    def write(
        self,
        key_values: dict[str, Any],
        key_excluded: dict[str, tuple[str, ...]],
        step: int = 0,
    ) -> None:
        """Send what is a number, now or later."""
        values = filter_excluded_keys(key_values, key_excluded, self._config.name)
        scalars = {key: float(value) for key, value in values.items() if isinstance(value, Real)}
        if scalars:
            self._waiting.append(Row(step, time.time(), scalars))
        if time.monotonic() >= self._retry_at_s:
            self._send()

    def close(self) -> None:
        """Nothing: `finish` does, once it is known how the run ended."""

    def finish(self, outcome: Outcome, files: Sequence[Path] = ()) -> None:
        """Send what waits, then files, and say how the run ended.

        Parameters
        ----------
        outcome
            How.
        files
            Those that do not exist are left out.
        """
        self._send()
        session = self._session
        if session is None or self._waiting:
            _tell(
                f"{self._config.name} is out of reach: {len(self._waiting)} rows of metrics are "
                f"in {self._run.folder} only"
            )
        if session is None:
            return
        try:
            existing = [path for path in files if path.exists()]
            if existing and not self._waiting:
                session.save_files(existing)
            session.finish(outcome)
        except Exception as error:  # the services' own kinds, and those of the network beneath
            self._warn(error)

    def _open(self) -> Session:
        if self._session is None:
            path = self._folder.path / FILE
            record = json.loads(path.read_text()) if path.exists() else {}
            self._session = self._config.open(self._run, record.get("run_id"))
            self._folder.write_json(
                FILE,
                {
                    "logger": self._config.name,
                    "run_id": self._session.run_id,
                    "url": self._session.url,
                },
            )
        return self._session

    def _send(self) -> None:
        start = time.monotonic()
        try:
            while self._waiting:
                session = self._open()
                if not _holds(session, self._waiting[0]):
                    session.log(self._waiting[0])
                self._waiting.popleft()
        except Exception as error:  # as above
            self._warn(error)
            now = time.monotonic()
            self._retry_at_s = now + max(_RETRY_AFTER_S, (now - start) / _SHARE_OF_TIME)

    def _warn(self, error: Exception) -> None:
        if not self._has_warned:
            _tell(f"{self._config.name} is out of reach, training goes on: {_said(error)}")
        self._has_warned = True


def _holds(session: Session, row: Row) -> bool:
    """Whether the service got a row before the run was interrupted."""
    if DECISIONS_LOGGED not in row.values:  # the last one, which has the step of the one before
        return row.step < session.last_step
    return row.step <= session.last_step


def _said(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _tell(message: str) -> None:
    # not through the middle of a progress bar
    tqdm.write(f"warning: {message}", file=sys.stderr)
