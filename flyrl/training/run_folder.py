"""The run folder: everything about one training run, and nothing outside it.

config.yaml          every setting, resolved
command.txt          the command, if there was one
code.diff            what the code had beyond its commit, if anything
provenance.json      commit, package versions, CPU
progress.csv         metrics, one row per update
tensorboard/         the same for TensorBoard
evaluations.csv      success and return on the held-out episodes
best.safetensors     policy bundle with the best evaluation
last.safetensors     policy bundle at the end
model.zip            Stable-Baselines3's model, to go on training (holds a pickle: your own only)
vecnormalize.pkl     Stable-Baselines3's VecNormalize for it, if the run normalises (a pickle too)
checkpoints/         the latest ones, to go on from after an interruption
status.json          how the run ended
logger.json          the run's id at the service that it is logged to, if there is one
wandb/               what Weights & Biases keeps, if that is the service
.lock                held by the process that trains
learning_curve.svg   success and return over the decisions, and the same as .png
best.mp4             the best policy on a held-out episode, where a video can be made
"""

import csv
import datetime
import io
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from flyrl.files import new_folder, write_text
from flyrl.training.checkpoint import SUFFIX, ResumeError
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.provenance import code_changes, provenance
from flyrl.training.runs import CONFIG_FILE, STATUS_FILE


def read_record(path: Path) -> dict[str, Any]:
    """Settings of the run in a folder, as `config.training_record` gave them.

    Raises
    ------
    ResumeError
        There is no run in the folder.
    """
    try:
        record: dict[str, Any] = yaml.safe_load((path / CONFIG_FILE).read_text())
    except (OSError, yaml.YAMLError) as error:
        raise ResumeError(f"{path} is not the folder of a run: {error}") from error
    return record


@dataclass(frozen=True)
class RunFolder:
    """Paths and small files of a run.

    Attributes
    ----------
    path
        The folder.
    """

    path: Path

    @classmethod
    def create(cls, config: TrainingConfig, runs: Path, command: Sequence[str] = ()) -> "RunFolder":
        """Make a new folder in `runs`, and write down what the run is and where it comes from.

        Parameters
        ----------
        config
            Goes into `config.yaml`.
        runs
            Made if missing.
        command
            Program and arguments, for `command.txt`.
        """
        started = datetime.datetime.now().astimezone()
        path = new_folder(runs, config.name(started))
        folder = cls(path)
        record = yaml.safe_dump(training_record(config), sort_keys=False)
        write_text(path / CONFIG_FILE, record)
        folder._note_command(command)
        changes = code_changes()
        if changes:
            write_text(path / "code.diff", changes)
        folder.write_json("provenance.json", {"started": started.isoformat(), **provenance()})
        return folder

    @classmethod
    def open(cls, config: TrainingConfig, path: Path, command: Sequence[str] = ()) -> "RunFolder":
        """Open the folder of an interrupted run, to go on with it.

        Parameters
        ----------
        config
            As the run was started with.
        path
            The folder.
        command
            Program and arguments, for another line of `command.txt`.

        Raises
        ------
        ResumeError
            There is no run in the folder, it has other settings, or it is finished.
        """
        if read_record(path) != training_record(config):
            raise ResumeError(f"{path} is a run with other settings: see its {CONFIG_FILE}")
        status = path / STATUS_FILE
        if status.exists() and json.loads(status.read_text())["interrupted_by"] is None:
            raise ResumeError(f"the run in {path} is finished; there is nothing to go on with")
        folder = cls(path)
        folder._note_command(command)
        return folder

    @property
    def best(self) -> Path:
        """Policy with the best evaluation."""
        return self.path / "best.safetensors"

    @property
    def last(self) -> Path:
        """Policy of the last evaluation, or of the end."""
        return self.path / "last.safetensors"

    @property
    def model(self) -> Path:
        """Model of Stable-Baselines3 beside `last`."""
        return self.path / "model.zip"

    @property
    def normaliser(self) -> Path:
        """VecNormalize of Stable-Baselines3 that goes with `model`."""
        return self.path / "vecnormalize.pkl"

    def checkpoint(self, decisions: int) -> Path:
        """Checkpoint after so many decisions."""
        folder = self.path / "checkpoints"
        folder.mkdir(exist_ok=True)
        return folder / f"{decisions:012}{SUFFIX}"

    def checkpoints(self) -> list[Path]:
        """The checkpoints there are, oldest first."""
        return sorted((self.path / "checkpoints").glob(f"[0-9]*{SUFFIX}"))

    def latest_checkpoint(self) -> Path:
        """The checkpoint to go on from.

        Raises
        ------
        ResumeError
            There is none.
        """
        checkpoints = self.checkpoints()
        if not checkpoints:
            raise ResumeError(f"there is no checkpoint in {self.path / 'checkpoints'}")
        return checkpoints[-1]

    def drop_checkpoints(self, keep: int) -> None:
        """Delete all checkpoints but the latest."""
        checkpoints = self.checkpoints()
        for path in checkpoints[: len(checkpoints) - keep]:
            path.unlink()

    def _note_command(self, command: Sequence[str]) -> None:
        path = self.path / "command.txt"
        earlier = path.read_text() if path.exists() else ""
        if command:
            write_text(path, earlier + shlex.join(command) + "\n")

    def write_json(self, name: str, record: Mapping[str, Any]) -> None:
        """Write a small JSON file."""
        write_text(self.path / name, json.dumps(record, indent=2, allow_nan=False) + "\n")

    def write_rows(self, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write a small CSV file; the columns are the keys of the first row."""
        text = io.StringIO()
        writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(self.path / name, text.getvalue())
