"""Weights & Biases."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

from flyrl.training.loggers.base import LocalRun, LoggerConfig, Outcome, Row, Session

_FINISH_TIMEOUT_S: Final = 120.0
"""Of the upload at the end, where W&B would wait for a lost network without limit."""

_EXIT_CODES: Final[dict[Outcome, int]] = {"finished": 0, "interrupted": 1, "failed": 1}


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

    def open(self, run: LocalRun, run_id: str | None) -> Session:
        """See `LoggerConfig.open`; what W&B keeps on disk lies in the run folder."""
        wandb = importlib.import_module("wandb")
        remote = wandb.init(
            project=self.project,
            entity=self.entity,
            group=self.group,
            name=run.folder.name,
            id=run_id,
            resume=run_id and "allow",
            config=dict(run.settings),
            dir=run.folder,
            reinit="create_new",
            # the terminal has a progress bar, of which W&B would keep every state
            settings=wandb.Settings(console="off", finish_timeout=_FINISH_TIMEOUT_S),
        )
        return _WandbSession(wandb, remote, run.last_step)


class _WandbSession(Session):
    def __init__(self, wandb: Any, remote: Any, last_step: int) -> None:
        self._wandb, self._remote = wandb, remote
        self.run_id = remote.id
        # offline, W&B does not know what it holds: all that was logged, then
        self.url = None if remote.offline else remote.url
        self.last_step = last_step if remote.offline else remote.starting_step - 1

    def log(self, row: Row) -> None:
        self._remote.log(dict(row.values), step=row.step)

    def save_files(self, paths: Sequence[Path]) -> None:
        artifact = self._wandb.Artifact(f"policy-{self.run_id}", type="model")
        for path in paths:
            artifact.add_file(str(path))
        self._remote.log_artifact(artifact)

    def finish(self, outcome: Outcome) -> None:
        self._remote.finish(exit_code=_EXIT_CODES[outcome])
