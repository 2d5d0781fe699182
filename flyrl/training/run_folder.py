"""The run folder: everything about one training run, and nothing outside it.

config.yaml          every setting, resolved
command.txt          the command, if there was one
code.diff            what the code had beyond its commit, if anything; code_2.diff: what it had
                     when the run was resumed, if that was something else
provenance.json      commit, preset of the physics, package versions, CPU; the same of every
                     time that the run was resumed
progress.csv         metrics, one row per update
tensorboard/         the same for TensorBoard
evaluations.csv      success, return, errors and unweighted reward terms on the held-out episodes
best.safetensors     policy bundle with the best evaluation
last.safetensors     policy bundle at the end
model.zip            Stable-Baselines3's model, to train on (holds a pickle: your own only)
vecnormalize.pkl     Stable-Baselines3's VecNormalize for it, if the run normalises (a pickle too)
checkpoints/         the latest ones, to resume from after an interruption
status.json          how the run ended
logger.json          the run's id at the service that it is logged to, if there is one
wandb/               what Weights & Biases keeps, if that is the service
.lock                held by the process that trains
learning_curve.svg   success and return over the decisions, and the same as .png
best.mp4             the best policy on a held-out episode, where a video can be made

A checkpoint is everything that the run's future depends on, in one file that executes no code: a
run that is resumed from it ends with the same bits as one that was never interrupted. The file is
PyTorch's, read with `weights_only=True`: tensors, numbers, text, lists and dicts.
"""

import datetime
import io
import json
import shlex
import shutil
import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
import yaml

from flyrl.files import new_folder, write_bytes, write_text
from flyrl.simulation.physics import preset_record
from flyrl.tasks import code_of
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.provenance import code_changes, differences, provenance
from flyrl.training.runs import (
    CHECKPOINT_SUFFIX,
    CONFIG_FILE,
    STATUS_FILE,
    ResumeError,
    checkpoint_files,
    nested,
    read_run,
)


def create_folder(
    config: TrainingConfig, runs: Path, command: Sequence[str] = (), label: str = ""
) -> Path:
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
    origin = _origin(config, started)
    name = config.name(started, label)
    folder = new_folder(runs, f".{name}")
    try:
        write_text(folder / CONFIG_FILE, yaml.safe_dump(training_record(config), sort_keys=False))
        _note_command(folder, command)
        write_json(folder / "provenance.json", origin)
        _write_changes(folder / "code.diff")
        return folder.rename(new_folder(runs, name))
    except BaseException:
        shutil.rmtree(folder)
        raise


def note_resumption(config: TrainingConfig, folder: Path, command: Sequence[str] = ()) -> None:
    """Note that the run in a folder is resumed, and clear away what its interruption left.

    Warns on stderr if code, packages or machine are not those of before.

    Parameters
    ----------
    config
        As the run was started with.
    folder
        The run folder.
    command
        Program and arguments, for another line of `command.txt`.
    """
    for place in (folder, folder / "checkpoints"):
        for left in place.glob(".partial-*"):  # of `flyrl.files`, by a process that was killed
            left.unlink(missing_ok=True)
    _note_command(folder, command)
    record = dict(read_run(folder).provenance)
    resumed = record.get("resumed")
    resumed = resumed if isinstance(resumed, list) else []
    earlier = resumed[-1] if resumed else record
    now = _origin(config, datetime.datetime.now().astimezone())
    write_json(folder / "provenance.json", {**record, "resumed": [*resumed, now]})
    if changed := differences(earlier, now, "now"):
        print(
            "warning: code, packages or machine are not those of before: the bits may differ:",
            *changed,
            sep="\n  ",
            file=sys.stderr,
        )
    if nested(earlier, "git.diff") != nested(now, "git.diff"):
        _write_changes(folder / f"code_{len(resumed) + 2}.diff")
    # its content no longer holds
    (folder / STATUS_FILE).unlink(missing_ok=True)


def write_json(path: Path, record: Mapping[str, Any]) -> None:
    """Write a small JSON file."""
    write_text(path, json.dumps(record, indent=2, allow_nan=False) + "\n")


def _origin(config: TrainingConfig, started: datetime.datetime) -> dict[str, Any]:
    return {
        "started": started.isoformat(),
        "physics_preset": preset_record(config.env.scene.physics),
        "decisive": list(config.env.resolved_task.decisive),
        **provenance(code_of(config.env.resolved_task)),
    }


def _write_changes(path: Path) -> None:
    if changes := code_changes():
        write_bytes(path, changes)


def _note_command(folder: Path, command: Sequence[str]) -> None:
    path = folder / "command.txt"
    earlier = path.read_text() if path.exists() else ""
    if command:
        write_text(path, earlier + shlex.join(command) + "\n")


_FORMAT: Final = 11

_PARTS: Final = ("learner", "env", "run", "settings")


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint, whole or not at all.

    Parameters
    ----------
    path
        Where to.
    state
        Nested dicts, lists and tuples of arrays, tensors, numbers and text.

    Raises
    ------
    OSError
        The disk is full or the folder cannot be written to; what stood at `path` still does.
    """
    # in memory first: of a full disk, torch.save would say no more than that it failed
    data = io.BytesIO()
    torch.save({"format": _FORMAT, "state": _map(state, _to_tensor)}, data)
    write_bytes(path, data.getvalue())


def load_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint; what was an array or a tensor is an array, except in "parameters".

    Raises
    ------
    OSError
        The file cannot be opened.
    ResumeError
        It is damaged, or no checkpoint of flyrl.
    """
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if damaged := archive.testzip():  # torch.load compares no checksums
                    raise ResumeError(f"{path} is damaged: its {damaged} is not as it was written")
            file.seek(0)
            record = torch.load(file, weights_only=True)
            if record["format"] != _FORMAT:
                raise ResumeError(f"{path} has format {record['format']!r}, known is {_FORMAT}")
            parameters = record["state"]["learner"].pop("parameters")
            state: dict[str, Any] = {
                part: _map(record["state"][part], _to_array) for part in _PARTS
            }
            int(state["run"]["decisions"])
        except ResumeError:
            raise
        except Exception as error:
            # torch names no common class for what a damaged file may raise: OSError, too
            raise ResumeError(f"{path} is damaged, or no checkpoint: {error}") from error
    state["learner"]["parameters"] = parameters
    return state


def checkpoint_file(folder: Path, decisions: int) -> Path:
    """Path of the checkpoint after so many decisions of the run in a folder."""
    checkpoints = folder / "checkpoints"
    checkpoints.mkdir(exist_ok=True)
    return checkpoints / f"{decisions:012}{CHECKPOINT_SUFFIX}"


def load_latest_checkpoint(folder: Path) -> dict[str, Any]:
    """Read the latest checkpoint of a run that can be read; those after it are renamed.

    Each that is renamed is a warning on stderr.

    Raises
    ------
    ResumeError
        There is none; of several damaged ones, the latest is named.
    """
    checkpoints = checkpoint_files(folder)[::-1]
    if not checkpoints:
        raise ResumeError(f"there is no checkpoint in {folder / 'checkpoints'}")
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


def _map(tree: Any, convert: Any) -> Any:
    """Convert every leaf of nested dicts, lists and tuples."""
    if isinstance(tree, Mapping):
        return {key: _map(value, convert) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        # a named tuple becomes a plain one
        kind = list if isinstance(tree, list) else tuple
        return kind(_map(value, convert) for value in tree)
    return convert(tree)


def _to_tensor(leaf: Any) -> Any:
    is_array = isinstance(leaf, np.ndarray | np.number | np.bool_)
    return torch.from_numpy(np.asarray(leaf, order="C")) if is_array else leaf


def _to_array(leaf: Any) -> Any:
    # of a tensor without axes, [()] makes a NumPy scalar, which is what it was
    return leaf.numpy()[()] if isinstance(leaf, torch.Tensor) else leaf
