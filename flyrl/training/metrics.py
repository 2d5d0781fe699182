"""Metrics of a run: a table, TensorBoard's files, and a service if one was asked for."""

import json
import sys
import time
from collections.abc import Callable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, Final

from stable_baselines3.common.logger import (
    CSVOutputFormat,
    KVWriter,
    Logger,
    TensorBoardOutputFormat,
    filter_excluded_keys,
)
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from flyrl.training.loggers import LoggerConfig, LoggerError, Outcome, RemoteRun
from flyrl.training.run_folder import write_json
from flyrl.training.runs import ResumeError, read_rows

_DECISIONS: Final = "time/total_timesteps"
"""Stable-Baselines3's name for the decisions so far, in every row but a run's last."""

_RECORD: Final = "logger.json"
_SENT_AT_END: Final = ("best.safetensors", "learning_curve.png", "best.mp4")
_PAUSE_S: Final = 60.0
_SHARE_OF_TIME: Final = 0.1
"""Of the training's, at most, that goes into waiting for a service out of reach."""


def metrics_logger(folder: Path, decisions: int | None, *more: KVWriter) -> Logger:
    """Logger of the metrics to `progress.csv`, for TensorBoard and to `more`.

    Parameters
    ----------
    folder
        Of the run.
    decisions
        At the checkpoint that the run is resumed from: what table and TensorBoard hold of later
        ones is dropped, as it is logged again. None for a new run.
    more
        Other writers.

    Raises
    ------
    ResumeError
        The table cannot be read.
    """
    tensorboard = TensorBoardOutputFormat(str(folder / "tensorboard"))
    table = folder / "progress.csv"
    values: list[dict[str, float]] = []
    if decisions is not None:
        tensorboard.writer.close()
        tensorboard.writer = SummaryWriter(folder / "tensorboard", purge_step=decisions + 1)
        # the header is torn if a kill came while the table got a new column: no row is safe then
        rows = [row for row in read_rows(table) if 0 <= _decisions(row) <= decisions]
        try:
            values = [{key: _number(text) for key, text in row.items() if text} for row in rows]
        except (TypeError, ValueError) as error:
            raise ResumeError(f"{table} does not hold numbers alone: {error!s:.200}") from error
    csv_format = CSVOutputFormat(str(table))
    for row_values in values:
        csv_format.write(row_values, {})
    return Logger(str(folder), [csv_format, tensorboard, *more])


def _decisions(row: Mapping[str, str]) -> int:
    """Decisions so far of a row of the table; -1 where it does not say."""
    text = row.get(_DECISIONS) or ""
    return int(text) if text.isdigit() else -1


def _number(text: str) -> float:
    return int(text) if text.isdigit() else float(text)


class RemoteLog(KVWriter):
    """Sends the scalars that are logged to a service, and never raises while it does.

    What a service out of reach does not get is in the run folder alone. A resumed run repeats some
    updates to the bit: what was logged of these before its interruption is not sent again.

    Parameters
    ----------
    config
        Which service.
    folder
        Of the run; `logger.json` in it holds the service's id of the run.
    settings
        As `config.training_record` gives them.
    """

    def __init__(self, config: LoggerConfig, folder: Path, settings: Mapping[str, Any]) -> None:
        self._config, self._folder, self._settings = config, folder, settings
        rows = read_rows(folder / "progress.csv")
        self._last_step = max(map(_decisions, rows), default=-1)
        self._run: RemoteRun | None = None
        self._missed = 0
        self._paused_until_s = 0.0

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
            raise LoggerError(f"logger={self._config.name}: {_one_line(error)}") from error

    def write(
        self,
        key_values: dict[str, Any],
        key_excluded: dict[str, tuple[str, ...]],
        step: int = 0,
    ) -> None:
        """Send what is a number."""
        values = filter_excluded_keys(key_values, key_excluded, self._config.name)
        scalars = {key: float(value) for key, value in values.items() if isinstance(value, Real)}
        # the last row, without the decisions, has the step of the one before
        last_step = self._last_step if _DECISIONS in scalars else self._last_step - 1
        if not scalars or step <= last_step:
            return
        start = time.monotonic()
        if start < self._paused_until_s or not self._done(lambda: self._open().log(scalars, step)):
            self._missed += 1

    def close(self) -> None:
        """Nothing: `finish` does, once it is known how the run ended."""

    def finish(self, outcome: Outcome) -> None:
        """Say how the run ended; of a finished one, send policy, learning curve and video."""
        if self._missed:
            _warn(
                f"{self._config.name} lacks {self._missed} rows of metrics, which are in "
                f"{self._folder / 'progress.csv'}"
            )
        if self._run is not None:
            names = _SENT_AT_END if outcome == "finished" else ()
            paths = [self._folder / name for name in names]
            files = [path for path in paths if path.exists()]
            run = self._run
            self._done(lambda: run.finish(outcome, files))

    def _open(self) -> RemoteRun:
        if self._run is None:
            path = self._folder / _RECORD
            record = json.loads(path.read_text()) if path.exists() else {}
            run_id = record.get("run_id")
            self._run = self._config.open(self._folder, self._settings, run_id)
            record = {"logger": self._config.name, "run_id": self._run.run_id}
            write_json(path, {**record, "url": self._run.url})
        return self._run

    def _done(self, task: Callable[[], object]) -> bool:
        """Whether the service did it; if not, it is left alone for a while."""
        start = time.monotonic()
        try:
            task()
        except Exception as error:  # the services' own kinds, and those of the network beneath
            if not self._paused_until_s:
                _warn(f"{self._config.name} is out of reach, training goes on: {_one_line(error)}")
            now = time.monotonic()
            self._paused_until_s = now + max(_PAUSE_S, (now - start) / _SHARE_OF_TIME)
            return False
        return True


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _warn(message: str) -> None:
    # not through the middle of a progress bar
    tqdm.write(f"warning: {message}", file=sys.stderr)
