"""The run folder: everything about one training run, and nothing outside it.

config.yaml          every setting, resolved
command.txt          the command, if there was one
provenance.json      commit, package versions, CPU
progress.csv         metrics, one row per update
tensorboard/         the same for TensorBoard
evaluations.csv      success and return on the held-out episodes
best.safetensors     policy bundle with the best evaluation
last.safetensors     policy bundle at the end
model.zip            Stable-Baselines3's model, to go on training (holds a pickle: your own only)
status.json          how the run ended
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
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.provenance import provenance


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
        write_text(path / "config.yaml", record)
        if command:
            write_text(path / "command.txt", shlex.join(command) + "\n")
        folder.write_json("provenance.json", {"started": started.isoformat(), **provenance()})
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
