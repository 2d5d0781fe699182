"""The run folder: everything about one training run, and nothing outside it.

config.yaml          every setting, resolved
command.txt          the command, if there was one
code.diff            what the code had beyond its commit, if anything; code_2.diff: what it had
                     when the run went on, if that was something else
provenance.json      commit, preset of the physics, package versions, CPU; the same of every
                     time that the run went on
progress.csv         metrics, one row per update
tensorboard/         the same for TensorBoard
evaluations.csv      success, return, errors and unweighted reward terms on the held-out episodes
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

import datetime
import json
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from flyrl.files import new_folder, write_bytes, write_text
from flyrl.simulation.physics import preset_record
from flyrl.tasks import code_of
from flyrl.text import csv_text
from flyrl.training.checkpoint import load_checkpoint
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.provenance import code_changes, differences, provenance
from flyrl.training.runs import (
    CHECKPOINT_SUFFIX,
    CONFIG_FILE,
    STATUS_FILE,
    ResumeError,
    checkpoint_files,
    is_finished,
    nested,
    read_record,
    read_run,
)


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
    def create(
        cls, config: TrainingConfig, runs: Path, command: Sequence[str] = (), label: str = ""
    ) -> "RunFolder":
        """Make a new folder in `runs`, and write down what the run is and where it comes from.

        It appears under its name with all of that in it, so that no reader meets half a run.

        Parameters
        ----------
        config
            Goes into `config.yaml`.
        runs
            Made if missing.
        command
            Program and arguments, for `command.txt`.
        label
            End of the folder's name.
        """
        started = datetime.datetime.now().astimezone()
        name = config.name(started, label)
        folder = cls(new_folder(runs, f".{name}"))
        try:
            record = yaml.safe_dump(training_record(config), sort_keys=False)
            write_text(folder.path / CONFIG_FILE, record)
            folder._note_command(command)
            folder.write_json("provenance.json", folder._origin(config, started))
            folder._write_changes("code.diff")
            return cls(folder.path.rename(new_folder(runs, name)))
        except BaseException:
            shutil.rmtree(folder.path)
            raise

    @classmethod
    def open(cls, config: TrainingConfig, path: Path) -> "RunFolder":
        """Open the folder of an interrupted run, to go on with it; nothing is written.

        Parameters
        ----------
        config
            As the run was started with.
        path
            The folder.

        Raises
        ------
        ResumeError
            There is no run in the folder, it has other settings, or it is finished.
        """
        if read_record(path) != training_record(config):
            raise ResumeError(f"{path} is a run with other settings: see its {CONFIG_FILE}")
        if is_finished(path):
            raise ResumeError(f"cannot resume {path}: the run has already finished")
        return cls(path)

    def go_on(self, config: TrainingConfig, command: Sequence[str] = ()) -> None:
        """Note that the run goes on, and clear away what its interruption left.

        Warns on stderr if code, packages or machine are not those of before.

        Parameters
        ----------
        config
            As the run was started with.
        command
            Program and arguments, for another line of `command.txt`.
        """
        for folder in (self.path, self.path / "checkpoints"):
            for left in folder.glob(".partial-*"):  # of `flyrl.files`, by a process that was killed
                left.unlink(missing_ok=True)
        self._note_command(command)
        record = dict(read_run(self.path).provenance)
        resumed = record.get("resumed")
        resumed = resumed if isinstance(resumed, list) else []
        earlier = resumed[-1] if resumed else record
        now = self._origin(config, datetime.datetime.now().astimezone())
        self.write_json("provenance.json", {**record, "resumed": [*resumed, now]})
        if changed := differences(earlier, now, "now"):
            print(
                "warning: code, packages or machine are not those of before: the bits may differ:",
                *changed,
                sep="\n  ",
                file=sys.stderr,
            )
        if nested(earlier, "git.diff") != nested(now, "git.diff"):
            self._write_changes(f"code_{len(resumed) + 2}.diff")
        # its content no longer holds
        (self.path / STATUS_FILE).unlink(missing_ok=True)

    @staticmethod
    def _origin(config: TrainingConfig, started: datetime.datetime) -> dict[str, Any]:
        return {
            "started": started.isoformat(),
            "physics_preset": preset_record(config.env.scene.physics),
            "decisive": list(config.env.resolved_task.decisive),
            **provenance(code_of(config.env.resolved_task)),
        }

    def _write_changes(self, name: str) -> None:
        if changes := code_changes():
            write_bytes(self.path / name, changes)

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
        return folder / f"{decisions:012}{CHECKPOINT_SUFFIX}"

    def checkpoints(self) -> list[Path]:
        """The checkpoints there are, oldest first."""
        return checkpoint_files(self.path)

    def load_latest_checkpoint(self) -> dict[str, Any]:
        """Read the latest checkpoint that can be read; those after it are renamed, with a warning.

        Raises
        ------
        ResumeError
            There is none; of several damaged ones, the latest is named.
        """
        checkpoints = self.checkpoints()[::-1]
        if not checkpoints:
            raise ResumeError(f"there is no checkpoint in {self.path / 'checkpoints'}")
        errors: list[ResumeError] = []
        for path in checkpoints:
            try:
                state = load_checkpoint(path)
            except ResumeError as error:
                errors.append(error)
                continue
            # out of the way: as the latest, they would be kept instead of the new ones
            for damaged in checkpoints[: len(errors)]:
                aside = damaged.rename(damaged.with_suffix(".damaged"))
                print(
                    f"warning: {damaged} cannot be read: it is now {aside.name}, and the run goes "
                    f"on from {path.name}",
                    file=sys.stderr,
                )
            return state
        raise errors[0]

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
        write_text(self.path / name, csv_text(list(rows[0]), rows))
