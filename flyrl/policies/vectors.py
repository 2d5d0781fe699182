"""Observations as the vectors that policies take."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def vectors(observation: Any) -> NDArray[np.float64]:
    """An observation, or a batch, as one array.

    Parameters
    ----------
    observation
        An array (..., k), or a dict of such arrays. Those are put side by side in the order of
        their names, as Stable-Baselines3's CombinedExtractor does.

    Raises
    ------
    ValueError
        Arrays of a dict that do not fit.
    """
    if isinstance(observation, Mapping):
        parts = [np.asarray(observation[name], dtype=np.float64) for name in sorted(observation)]
        return np.concatenate(parts, axis=-1)
    return np.asarray(observation, dtype=np.float64)
