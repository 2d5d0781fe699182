"""What an evaluation has walked so far: a file per batch of episodes, to go on from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from flyrl.evaluation.rows import episode_table, plain_rows
from flyrl.evaluation.trajectories import Trajectory, pack_trajectories, unpack_trajectories
from flyrl.files import OutputFolder, load_arrays

PARTS_FOLDER: Final = "parts"

Part = tuple[pd.DataFrame, list[Trajectory]]
"""Rows of a batch, and the paths of the first of them."""


class Parts:
    """Batches of episodes in a folder, of an evaluation of certain settings.

    Parameters
    ----------
    folder
        Of the results. None keeps nothing.
    settings
        Plain JSON values; what was walked with others does not count.
    """

    def __init__(self, folder: Path | None, settings: Any) -> None:
        self._folder = None if folder is None else OutputFolder(folder)
        text = json.dumps(settings, sort_keys=True)
        self._digest = np.frombuffer(hashlib.sha256(text.encode()).digest(), dtype=np.uint8)

    def read(self, place: Sequence[int]) -> Part | None:
        """Rows and paths of a batch; None where there are none, or not whole.

        Parameters
        ----------
        place
            Numbers that tell the batch from all others.
        """
        if self._folder is None:
            return None
        try:
            arrays = load_arrays(self._folder.path / _name(place))
            if not np.array_equal(arrays["settings"], self._digest):
                return None
            rows = episode_table(json.loads(arrays["rows"].tobytes()))
            return rows, unpack_trajectories(arrays)
        except (OSError, KeyError, TypeError, ValueError):
            return None

    def write(self, place: Sequence[int], part: Part) -> None:
        """Keep a batch.

        Raises
        ------
        OSError
            The folder cannot be written to.
        """
        if self._folder is None:
            return
        rows, paths = part
        text = np.frombuffer(json.dumps(list(plain_rows(rows))).encode(), dtype=np.uint8)
        with self._folder.replacing(_name(place)) as partial:
            np.savez_compressed(
                partial, settings=self._digest, rows=text, **pack_trajectories(paths)
            )


def _name(place: Sequence[int]) -> str:
    return f"{PARTS_FOLDER}/{'-'.join(map(str, place))}.npz"


def drop_parts(folder: Path) -> None:
    """Drop the batches in a folder of results, once these hold them."""
    output = OutputFolder(folder)
    output.remove(*output.files(PARTS_FOLDER))
