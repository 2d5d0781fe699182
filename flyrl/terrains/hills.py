"""Hills: smooth random heights."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from scipy.ndimage import gaussian_filter

from flyrl.terrains.terrain import Bounds, Heights, Terrain
from flyrl.validation import Within

HALF_WIDTH: Final = 75.0
"""mm, of the field."""

LEVEL: Final = 5.0
"""mm; no ground within this distance of the start is above 0."""

_CELLS_PER_WIDTH: Final = 4
_FURTHEST_SHIFT: Final = 25.0


@dataclass(frozen=True, kw_only=True)
class Hills(Terrain):
    """Smooth hills: noise, blurred, in a field of 150 x 150 mm.

    Random ground is another part of the same field; its heights do not follow the difficulty.

    Attributes
    ----------
    height : from the lowest to the highest place of the field, mm.
    width : standard deviation of the blur, mm; from one hill to the next it is some five times as
        far.
    """

    height: Annotated[float, Within(0.01, 50)] = 3.0
    width: Annotated[float, Within(1, 20)] = 3.0

    @property
    def bounds(self) -> Bounds:
        """Where there is ground to walk on."""
        edge = HALF_WIDTH - _FURTHEST_SHIFT
        return Bounds(-edge, edge, -edge, edge, z_min=-self.height - 5.0)

    @property
    def floor(self) -> None:
        """There is no plane below it."""
        return

    def heights(self) -> Heights:
        """The field."""
        return _field(self.seed, self.height, self.width)

    def shift(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """Draw which part of the field is walked on; the start's surroundings end at height 0."""
        x, y = 0.0, 0.0
        if self.random:
            x, y = map(float, rng.uniform(-_FURTHEST_SHIFT, _FURTHEST_SHIFT, size=2))
        near = np.linspace(-LEVEL, LEVEL, 41)
        heights = self.heights().at(*np.meshgrid(near - x, near - y))
        return x, y, -float(heights.max())


@functools.lru_cache(maxsize=8)
def _field(seed: int, height: float, width: float) -> Heights:
    cell = width / _CELLS_PER_WIDTH
    size = 1 + round(2 * HALF_WIDTH / cell)
    noise = np.random.default_rng(seed).uniform(size=(size, size))
    values = gaussian_filter(noise, _CELLS_PER_WIDTH, mode="wrap")
    values = (values - values.min()) * (height / np.ptp(values))
    return Heights(values, 2 * HALF_WIDTH / (size - 1))
