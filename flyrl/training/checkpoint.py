"""Checkpoints: everything that a run's future depends on, in one file that executes no code.

A run that goes on from a checkpoint ends with the same bits as one that was never interrupted. The
file is PyTorch's, read with `weights_only=True`: tensors, numbers, text, lists and dicts.
"""

import io
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from flyrl.files import write_bytes
from flyrl.training.runs import CHECKPOINT_SUFFIX, ResumeError, checkpoint_files

_FORMAT: Final = 10

_PARTS: Final = frozenset(("learner", "env", "run", "settings"))


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
            state: dict[str, Any] = record["state"]
            parameters = state["learner"].pop("parameters")
            if missing := _PARTS - state.keys():
                raise ResumeError(f"{path} lacks {', '.join(sorted(missing))}")
            int(state["run"]["decisions"])
        except ResumeError:
            raise
        except Exception as error:
            # torch names no common class for what a damaged file may raise: OSError, too
            raise ResumeError(f"{path} is damaged, or no checkpoint: {error}") from error
    restored: dict[str, Any] = _map(state, _to_array)
    restored["learner"]["parameters"] = parameters
    return restored


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
        return type(tree)(_map(value, convert) for value in tree)
    return convert(tree)


def _to_tensor(leaf: Any) -> Any:
    is_array = isinstance(leaf, np.ndarray | np.number | np.bool_)
    return torch.from_numpy(np.asarray(leaf, order="C")) if is_array else leaf


def _to_array(leaf: Any) -> Any:
    # of a tensor without axes, [()] makes a NumPy scalar, which is what it was
    return leaf.numpy()[()] if isinstance(leaf, torch.Tensor) else leaf
