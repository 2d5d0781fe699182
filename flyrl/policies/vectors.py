"""Observations as the vectors that policies take."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def vectors(observation: Any, sizes: Mapping[str, int] | None = None) -> NDArray[np.float64]:
    """An observation, or a batch, as one array.

    Parameters
    ----------
    observation
        An array (..., k), or a dict of such arrays. Those are put side by side in the order of
        their names, as Stable-Baselines3's CombinedExtractor and `gymnasium.spaces.flatten` do.
    sizes
        Numbers of values by name, of a dict whose arrays have rows and columns.

    Raises
    ------
    ValueError
        Arrays of a dict that do not fit.
    """
    if isinstance(observation, Mapping):
        parts = {name: np.asarray(observation[name], np.float64) for name in sorted(observation)}
        if sizes and sizes.keys() == parts.keys():
            is_batch = all(
                part.size != sizes[name] or len(part) == 1 for name, part in parts.items()
            )
            parts = {
                name: part.reshape((-1, sizes[name]) if is_batch else -1)
                for name, part in parts.items()
            }
        return np.concatenate([*parts.values()], axis=-1)
    return np.asarray(observation, dtype=np.float64)
