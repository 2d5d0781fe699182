"""Services that the metrics of a run can be sent to, beside its folder; none by default.

Importing this imports no service: opening a run there does.
"""

import importlib
import importlib.util
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from flyrl.resources import install_command
from flyrl.training.runs import flat

Outcome = Literal["finished", "interrupted", "failed"]


class LoggerError(OSError):
    """A service cannot be used."""


@dataclass(frozen=True)
class RemoteRun:
    """A run that is open at a service. Both functions may raise anything that the service does.

    Attributes
    ----------
    run_id
        The service's name for the run.
    url
        Page of the run, if there is one.
    log
        Sends metrics by name, with the number of decisions so far.
    finish
        Sends files, to be kept with the run, and says how it ended.
    """

    run_id: str
    url: str | None
    log: Callable[[dict[str, float], int], object]
    finish: Callable[[Outcome, Sequence[Path]], object]


@dataclass(frozen=True, kw_only=True)
class LoggerConfig(ABC):
    """Settings that the loggers of every service have."""

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
    def open(self, folder: Path, settings: Mapping[str, Any], run_id: str | None) -> RemoteRun:
        """Start a run at the service, or resume the one that has an id.

        Parameters
        ----------
        folder
            Run folder, whose name the run has at the service too.
        settings
            As `config.training_record` gives them.
        run_id
            The service's name for a run that is resumed.
        """


@dataclass(frozen=True, kw_only=True)
class WandbConfig(LoggerConfig):
    """Logging to Weights & Biases; W&B's own variables (WANDB_MODE, …) hold as well.

    Attributes
    ----------
    project
        Made if missing.
    entity
        User or team; None takes the default of whoever is logged in.
    group
        Shows runs together; None shows them one by one.
    """

    name: ClassVar = "wandb"

    project: str = "flyrl"
    entity: str | None = None
    group: str | None = None

    def open(self, folder: Path, settings: Mapping[str, Any], run_id: str | None) -> RemoteRun:
        """See `LoggerConfig.open`; what W&B keeps on disk lies in the run folder."""
        wandb = importlib.import_module("wandb")
        run = wandb.init(
            project=self.project,
            entity=self.entity,
            group=self.group,
            name=folder.name,
            id=run_id,
            resume=run_id and "allow",
            config=dict(settings),
            dir=folder,
            reinit="create_new",
            # the terminal has a progress bar, of which W&B would keep every state; and for the
            # upload at the end, 120 s, W&B would wait without limit if the network is lost
            settings=wandb.Settings(console="off", finish_timeout=120.0),
        )

        def finish(outcome: Outcome, files: Sequence[Path]) -> None:
            if files:
                artifact = wandb.Artifact(f"policy-{run.id}", type="model")
                for path in files:
                    artifact.add_file(str(path))
                run.log_artifact(artifact)
            run.finish(exit_code=0 if outcome == "finished" else 1)

        return RemoteRun(run.id, None if run.offline else run.url, run.log, finish)


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

    def open(self, folder: Path, settings: Mapping[str, Any], run_id: str | None) -> RemoteRun:
        """See `LoggerConfig.open`."""
        # training waits for MLflow's requests: no longer than this, unless the user says so
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "10")
        mlflow = importlib.import_module("mlflow")
        client = mlflow.MlflowClient(tracking_uri=self.tracking_uri)
        if run_id is None:
            experiment = client.get_experiment_by_name(self.experiment)
            if experiment is None:
                # another run of a sweep may have made it by now
                with suppress(mlflow.exceptions.MlflowException):
                    client.create_experiment(self.experiment)
                experiment = client.get_experiment_by_name(self.experiment)
            run = client.create_run(experiment.experiment_id, run_name=folder.name)
            entity = mlflow.entities.Param
            values = [entity(key, str(value)) for key, value in flat(settings).items()]
            client.log_batch(run.info.run_id, params=values)
        else:
            client.update_run(run_id, status="RUNNING")
            run = client.get_run(run_id)
        run_id = run.info.run_id
        url = None
        if str(client.tracking_uri).startswith("http"):
            page = f"#/experiments/{run.info.experiment_id}/runs/{run_id}"
            url = f"{client.tracking_uri}/{page}"

        def log(values: Mapping[str, float], step: int) -> None:
            now_ms = int(1000 * time.time())
            metric = mlflow.entities.Metric
            metrics = [metric(key, value, now_ms, step) for key, value in values.items()]
            client.log_batch(run_id, metrics=metrics)

        def finish(outcome: Outcome, files: Sequence[Path]) -> None:
            for path in files:
                client.log_artifact(run_id, str(path))
            status = {"finished": "FINISHED", "interrupted": "KILLED", "failed": "FAILED"}
            client.set_terminated(run_id, status[outcome])

        return RemoteRun(str(run_id), url, log, finish)


LOGGERS: Final[Mapping[str, type[LoggerConfig]]] = {"wandb": WandbConfig, "mlflow": MlflowConfig}
"""Name -> settings."""
