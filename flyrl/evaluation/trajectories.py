"""Paths of episodes as results keep them, in single precision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flyrl.rollouts.records import EpisodeRecord


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Path of one episode: float32 arrays over its samples, fields as in `EpisodeRecord`."""

    time_s: NDArray[np.float32]
    position_w: NDArray[np.float32]
    yaw: NDArray[np.float32]
    drive: NDArray[np.float32]


def trajectory(record: EpisodeRecord) -> Trajectory:
    """Path of one episode, in single precision."""
    return Trajectory(
        record.time_s.astype(np.float32),
        record.position_w.astype(np.float32),
        record.yaw.astype(np.float32),
        record.drive.astype(np.float32),
    )


def pack_trajectories(paths: Sequence[Trajectory]) -> dict[str, Any]:
    """Plain arrays of many paths: how long each is, and their fields one after the other."""
    if not paths:
        return {"lengths": np.zeros(0, dtype=np.int64)}
    columns = {
        key: np.concatenate([getattr(path, key) for path in paths])
        for key in Trajectory.__dataclass_fields__
    }
    return {"lengths": np.array([len(path.time_s) for path in paths], dtype=np.int64), **columns}


def unpack_trajectories(arrays: Mapping[str, NDArray[Any]]) -> list[Trajectory]:
    """Paths from what `pack_trajectories` made of them.

    Raises
    ------
    KeyError
        An array is missing.
    """
    if not arrays["lengths"].size:
        return []
    cuts = np.cumsum(arrays["lengths"])[:-1]
    columns = [np.split(arrays[key], cuts) for key in Trajectory.__dataclass_fields__]
    return [Trajectory(*fields) for fields in zip(*columns, strict=True)]
