"""Ground without boxes: planes, slopes, smooth hills, and what a tethered fly walks on."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Annotated, Final

import mujoco
import numpy as np

from flyrl.bodies.fly import BOXES
from flyrl.terrains.geoms import GROUND_GEOM, add_checks
from flyrl.terrains.terrain import Bounds, Heights, Terrain
from flyrl.validation import Within


@dataclass(frozen=True, kw_only=True)
class Flat(Terrain):
    """A plane."""

    drawn_from = ()


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

    drawn_from = ("angle_range_deg", "uphill_range_deg")
    # a fly that is 10 mm off it has fallen
    bounds = Bounds(-100.0, 100.0, -100.0, 100.0, z_max=10.0)

    def down(self, rng: np.random.Generator, difficulty: float) -> tuple[float, float, float]:
        """Draw the unit vector along which things fall; with the difficulty it gets steeper."""
        angle = difficulty * math.radians(rng.uniform(*self.angle_range_deg))
        uphill = math.radians(rng.uniform(*self.uphill_range_deg))
        level = -math.sin(angle)
        return level * math.cos(uphill), level * math.sin(uphill), -math.cos(angle)


HALF_WIDTH: Final = 75.0
"""mm, of the field."""

HILLS_EDGE: Final = 50.0
"""mm; so far from the start there are hills, whichever part of the field is walked on."""

LEVEL: Final = 5.0
"""mm; no ground within this distance of the start is above 0."""

_CELLS_PER_WIDTH: Final = 4
_FURTHEST_SHIFT: Final = HALF_WIDTH - HILLS_EDGE


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
        z_min = -self.height - 5.0
        return Bounds(-HILLS_EDGE, HILLS_EDGE, -HILLS_EDGE, HILLS_EDGE, z_min)

    floor = None

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
    from scipy.ndimage import gaussian_filter  # noqa: PLC0415 - slow to import

    cell = width / _CELLS_PER_WIDTH
    size = 1 + round(2 * HALF_WIDTH / cell)
    noise = np.random.default_rng(seed).uniform(size=(size, size))
    values = gaussian_filter(noise, _CELLS_PER_WIDTH, mode="wrap")
    values = (values - values.min()) * (height / np.ptp(values))
    return Heights(values, 2 * HALF_WIDTH / (size - 1))


BALL: Final = "ball"
"""Name of the ball's body and joint."""

_TOP: Final = 1.0
"""mm; so high is the ball that a fly, put down in the air as anywhere, stands on it."""

_THORAX_X: Final = 0.496
"""mm; where the thorax is of a fly that is put down at the origin."""


@dataclass(frozen=True, kw_only=True)
class _Held(Terrain):
    """Ground of a tethered fly, which always starts at the origin."""

    drawn_from = ()
    spawn = Bounds(0.0, 0.0, 0.0, 0.0)
    floor = None


@dataclass(frozen=True, kw_only=True)
class Air(_Held):
    """Nothing to stand on; for a body that is tethered."""


@dataclass(frozen=True, kw_only=True)
class Ball(_Held):
    """A ball that turns under the legs; for a body that is tethered.

    Attributes
    ----------
    radius : mm.
    mass : g, of a thin shell. With the usual 0.0015 g it resists as a fly of 1 mg would that had
        to carry itself.
    damping : of the bearing, µN·mm·s.
    """

    radius: Annotated[float, Within(1, 100)] = 4.5
    mass: Annotated[float, Within(1e-5, 10)] = 0.0015
    damping: Annotated[float, Within(0, 1e3)] = 0.01

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the ball."""
        body = spec.worldbody.add_body(name=BALL, pos=(_THORAX_X, 0.0, _TOP - self.radius))
        body.add_joint(name=BALL, type=mujoco.mjtJoint.mjJNT_BALL, damping=self.damping)
        inertia = 2 / 3 * self.mass * self.radius**2
        body.explicitinertial = True
        body.mass = self.mass
        body.inertia = (inertia, inertia, inertia)
        material = add_checks(spec, BALL, mujoco.mjtTexture.mjTEXTURE_CUBE, pixels=64)
        material.texrepeat = (4.0, 4.0)
        body.add_geom(
            name="ground_ball",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=(self.radius, 0, 0),
            mass=0,
            material=BALL,
            contype=BOXES,
            **GROUND_GEOM,
        )
