"""Observations with the mean subtracted, divided by the standard deviation, and clipped."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flyrl.validation import float_array, positive


@dataclass(frozen=True, eq=False)
class Normaliser:
    """Statistics of the observations that a policy was trained on.

    Attributes
    ----------
    mean, variance
        Of every value of the observation, shape (k,) each.
    epsilon
        Added to the variance.
    clip
        Normalised values lie within this of 0.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    epsilon: float
    clip: float

    def __post_init__(self) -> None:
        shape = (np.size(self.mean),)
        object.__setattr__(self, "mean", float_array("normaliser.mean", self.mean, shape))
        variance = float_array("normaliser.variance", self.variance, shape, minimum=0.0)
        object.__setattr__(self, "variance", variance)
        positive("normaliser.epsilon", self.epsilon)
        positive("normaliser.clip", self.clip)

    def apply(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalised observations, (n, k), each value rounded to float32 as in training."""
        scaled = (observations - self.mean) / np.sqrt(self.variance + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32).astype(np.float64)
