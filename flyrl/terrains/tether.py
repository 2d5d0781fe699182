"""Where tethered flies walk: in the air, or on a ball."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import mujoco

from flyrl.bodies.fly import BOXES
from flyrl.terrains.geoms import GROUND_FRICTION, add_checks
from flyrl.terrains.terrain import Bounds, Terrain, check_not_random
from flyrl.validation import Within

BALL: Final = "ball"
"""Name of the ball's body and joint."""

_TOP: Final = 1.0
"""mm; so high is the ball that a fly, put down in the air as anywhere, stands on it."""

_THORAX_X: Final = 0.496
"""mm; where the thorax is of a fly that is put down at the origin."""


@dataclass(frozen=True, kw_only=True)
class _Held(Terrain):
    """What both have in common: every fly starts at the same place."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_not_random(self, self.name)

    @property
    def spawn(self) -> Bounds:
        """The origin."""
        return Bounds(0.0, 0.0, 0.0, 0.0)

    @property
    def floor(self) -> None:
        """There is none."""
        return


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
            conaffinity=0,
            group=0,
            friction=GROUND_FRICTION,
        )
