"""Level ground, and slopes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flyrl.terrains.terrain import Bounds, Terrain, check_not_random, check_ranges
from flyrl.validation import Within


@dataclass(frozen=True, kw_only=True)
class Flat(Terrain):
    """A plane."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_not_random(self, "flat ground")


@dataclass(frozen=True, kw_only=True)
class Slope(Terrain):
    """A plane that rises: gravity is turned, so that the world's z axis stays normal to it.

    Attributes
    ----------
    angle_range_deg : least and greatest angle of the slope, from 0, level, over 90, a wall, to 180,
        a ceiling.
    uphill_range_deg : least and greatest direction in which it rises most, from +x to the left.
    """

    angle_range_deg: Annotated[tuple[float, float], Within(0, 180)] = (20.0, 20.0)
    uphill_range_deg: Annotated[tuple[float, float], Within(-180, 180)] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_ranges(self, "angle_range_deg", "uphill_range_deg")

    @property
    def bounds(self) -> Bounds:
        """Where there is ground to walk on; a fly that is 10 mm off it has fallen."""
        return Bounds(-100.0, 100.0, -100.0, 100.0, z_max=10.0)

    def down(self, rng: np.random.Generator, difficulty: float) -> tuple[float, float, float]:
        """Draw the unit vector along which things fall; with the difficulty it gets steeper."""
        angle = difficulty * math.radians(rng.uniform(*self.angle_range_deg))
        uphill = math.radians(rng.uniform(*self.uphill_range_deg))
        level = -math.sin(angle)
        return level * math.cos(uphill), level * math.sin(uphill), -math.cos(angle)
