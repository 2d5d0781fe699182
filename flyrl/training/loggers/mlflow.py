"""MLflow."""

import importlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

from flyrl.training.loggers.base import (
    DECISIONS_LOGGED,
    LocalRun,
    LoggerConfig,
    Outcome,
    Row,
    Session,
)
from flyrl.training.runs import flat

_PATIENCE: Final = {"MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2", "MLFLOW_HTTP_REQUEST_TIMEOUT": "10"}
"""Training waits for MLflow's requests: no longer than this, unless the user says so."""

_PARAMETERS_AT_ONCE: Final = 100
"""MLflow's limit."""

_STATUSES: Final[dict[Outcome, str]] = {
    "finished": "FINISHED",
    "interrupted": "KILLED",
    "failed": "FAILED",
}


@dataclass(frozen=True, kw_only=True)
class MlflowConfig(LoggerConfig):
    """Logging to MLflow; MLflow's own variables (MLFLOW_TRACKING_URI, …) hold as well.

    Attributes
    ----------
    experiment
        Made if missing.
    tracking_uri
        Address of the server; None takes MLFLOW_TRACKING_URI, or MLflow's own default.
    """

    name: ClassVar = "mlflow"

    experiment: str = "flyrl"
    tracking_uri: str | None = None

    def open(self, run: LocalRun, run_id: str | None) -> Session:
        """See `LoggerConfig.open`."""
        for variable, value in _PATIENCE.items():
            os.environ.setdefault(variable, value)
        mlflow = importlib.import_module("mlflow")
        client = mlflow.MlflowClient(tracking_uri=self.tracking_uri)
        if run_id is None:
            experiment_id = self._experiment_id(mlflow, client)
            run_id = client.create_run(experiment_id, run_name=run.folder.name).info.run_id
            parameters = [
                mlflow.entities.Param(key, str(value)) for key, value in flat(run.settings).items()
            ]
            for first in range(0, len(parameters), _PARAMETERS_AT_ONCE):
                some = parameters[first : first + _PARAMETERS_AT_ONCE]
                client.log_batch(run_id, params=some)
        else:
            client.update_run(run_id, status="RUNNING")
        return _MlflowSession(mlflow, client, run_id)

    def _experiment_id(self, mlflow: Any, client: Any) -> str:
        experiment = client.get_experiment_by_name(self.experiment)
        if experiment is None:
            try:
                return str(client.create_experiment(self.experiment))
            except mlflow.exceptions.MlflowException:
                # another run of a sweep may have made it by now
                experiment = client.get_experiment_by_name(self.experiment)
                if experiment is None:
                    raise
        return str(experiment.experiment_id)


class _MlflowSession(Session):
    def __init__(self, mlflow: Any, client: Any, run_id: str) -> None:
        self._mlflow, self._client = mlflow, client
        self.run_id = run_id
        self.url = None
        address = str(client.tracking_uri)
        if address.startswith("http"):
            experiment_id = client.get_run(run_id).info.experiment_id
            self.url = f"{address}/#/experiments/{experiment_id}/runs/{run_id}"
        held = client.get_metric_history(run_id, DECISIONS_LOGGED)
        self.last_step = max((metric.step for metric in held), default=-1)

    def log(self, row: Row) -> None:
        milliseconds = int(1000 * row.time_s)
        metrics = [
            self._mlflow.entities.Metric(key, value, milliseconds, row.step)
            for key, value in row.values.items()
        ]
        self._client.log_batch(self.run_id, metrics=metrics)

    def save_files(self, paths: Sequence[Path]) -> None:
        for path in paths:
            self._client.log_artifact(self.run_id, str(path))

    def finish(self, outcome: Outcome) -> None:
        self._client.set_terminated(self.run_id, _STATUSES[outcome])
