"""A worm as a MuJoCo model specification: a chain of capsules, with muscles as sites.

In its own frame the worm lies straight along x with its head forward, its right to -y and its back
to +z, like the fly. Units mm, g, s, rad; forces in µN, torques in µN mm.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal

import mujoco
import numpy as np

from flyrl.bodies.fly import PLANES
from flyrl.bodies.surface import COLLISION_GROUP, GRAVITY, add_sun, set_look
from flyrl.resources import muscle_profile, recorded_profile
from flyrl.validation import Within, check_fields

Axis = Literal["y", "z"]
Mount = Literal["hanging", "crawling", "suspended"]
Muscles = Literal["pairs", "one"]

CRAWLING_ROOT: Final = ("root_x", "root_y", "root_z", "root_yaw")
"""Joints of a crawling worm's head: three slides along the world's axes, then a hinge about z."""

_FOOT_LENGTH: Final = 0.6
_FOOT_RISE: Final = 0.09
"""How long a foot is, and by how much its front end lies higher, in radii of the worm."""

FOOT_SOLREF: Final = (0.01, 1.0)
FOOT_SOLIMP: Final = (0.1, 0.5, 0.1, 0.5, 2.0)
"""Contact of a foot: so soft that MuJoCo's solver has half the work, and the worm, which sinks in
by 0.04 mm, comes about as far as on hard ground."""

TIMESTEP: Final = 1e-3
"""s; four times as much explodes on the ground where muscles pull at random with all strength."""

JOINT_LIMIT_SOLREF: Final = (0.01, 1.0)
"""Limits of joints stop softly, within ten time steps."""

MUSCLE_HEIGHT: Final = 1.2
"""Distance of a muscle from a segment's axis, in radii."""

_SKINS: Final = ((0.86, 0.55, 0.48, 1.0), (0.78, 0.47, 0.41, 1.0))
"""Colours of segments, in turn."""

_MUSCLE_COLOUR: Final = (0.65, 0.05, 0.05, 1.0)


_HALF: Final = math.sqrt(0.5)
_Side = tuple[str, tuple[float, float, float], tuple[float, float, float, float]]
_SIDES: Final[dict[Axis, tuple[_Side, ...]]] = {
    "y": (
        ("dorsal", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)),
        ("ventral", (0.0, 0.0, -1.0), (0.0, 1.0, 0.0, 0.0)),
    ),
    "z": (
        ("left", (0.0, 1.0, 0.0), (_HALF, -_HALF, 0.0, 0.0)),
        ("right", (0.0, -1.0, 0.0), (_HALF, _HALF, 0.0, 0.0)),
    ),
}
"""Sides of a joint's two muscles, by the joint's axis: name, direction in the segment's frame, and
how the muscle is turned.

The tail lies behind the joint, along -x. So a right-handed turn about +y lifts it to the back,
+z, and one about +z takes it to the right, -y. The quaternions turn the muscle's y axis to the
axis about which the tail moves towards the muscle.
"""

_AXES: Final[dict[Axis, tuple[float, float, float]]] = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

_HEAD_UP: Final = (_HALF, 0.0, -_HALF, 0.0)
"""Turns x upwards, and the back, z, to -x."""

_HEAD_DOWN: Final = (_HALF, 0.0, _HALF, 0.0)
"""Turns x downwards, and the back, z, to +x."""


@dataclass(frozen=True)
class WormConfig:
    """Which worm.

    Attributes
    ----------
    segments : how many, 2 or more; one joint less.
    radius : of a segment, mm.
    segment_length : from one joint to the next, mm.
    density : g/mm³; that of water by default.
    joint_stiffness, joint_damping : of a joint's spring, which keeps the worm straight, µN mm/rad,
        and of its damper, µN mm s/rad.
    joint_range : how far a joint bends to either side, rad.
    hinge_axes : axes of the joints from head to tail, in turn: about "y" the worm bends up and
        down, about "z" to its left and right.
    strength : of every muscle, µN mm.
    profile : of every muscle's motor pool: the name of an image in assets/muscles, or the path of
        one of your own, see `flyrl.muscles.MotorPool.from_image`.
    muscles : "pairs", two antagonists per joint; or "one", for demonstrations: the first muscle of
        the last joint.
    anchored : whether every muscle pulls against the segment before its own, as in animals, and so
        bends no joint but its own. Otherwise nothing feels the opposite torque, as in the
        literature: a muscle bends all joints up to the head.
    mount : "hanging", with the first segment fixed to the world and the others below it;
        "suspended", with the first segment held in mid air and the others above it, without
        gravity; or "crawling", lying straight on a ground at z = 0 with its head to +x, unable to
        pitch or roll, and with feet that slip more easily along the worm than across it, as
        bristles do.
    friction_along, friction_across : sliding friction of a crawling worm's feet, along and across
        their segment.
    """

    simulated_by: ClassVar[str] = "flyrl.simulation.worms:WormBatch"

    segments: Annotated[int, Within(2, 1000)] = 10
    radius: Annotated[float, Within(1e-3, 1e3)] = 1.0
    segment_length: Annotated[float, Within(1e-3, 1e3)] = 3.0
    density: Annotated[float, Within(1e-6, 1e3)] = 1e-3
    joint_stiffness: Annotated[float, Within(0, 1e9)] = 4000.0
    joint_damping: Annotated[float, Within(0, 1e9)] = 250.0
    joint_range: Annotated[float, Within(0.01, math.pi)] = 1.0
    hinge_axes: tuple[Axis, ...] = ("y",)
    strength: Annotated[float, Within(0, 1e9)] = 3500.0
    profile: str = "human.png"
    muscles: Muscles = "pairs"
    anchored: bool = True
    mount: Mount = "hanging"
    friction_along: Annotated[float, Within(0, 1e3)] = 0.3
    friction_across: Annotated[float, Within(0, 1e3)] = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "body")
        if not self.hinge_axes:
            raise ValueError("body.hinge_axes must name at least one axis, got none")
        object.__setattr__(self, "profile", recorded_profile("body.profile", self.profile))

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.segments - 1

    @property
    def profile_path(self) -> Path:
        """Image of every muscle's motor pool."""
        return muscle_profile("body.profile", self.profile)

    def axis(self, joint: int) -> Axis:
        """Axis of a joint, of 1 (between the first two segments) to `joints`."""
        return self.hinge_axes[(joint - 1) % len(self.hinge_axes)]


DEMONSTRATION: Final = WormConfig(muscles="one", anchored=False, mount="suspended", strength=1400.0)
"""The literature's worm: suspended in mid air without gravity. Its lowest segment is held, its one
muscle moves the uppermost, and all of it bends: by 180° with all neurons."""

CRAWLER: Final = WormConfig(
    segments=6, joint_damping=500.0, hinge_axes=("z",), profile="small.png", mount="crawling"
)
HANGER: Final = WormConfig(segments=5, profile="small.png")

WORMS: Final[dict[str, WormConfig]] = {"worm_crawler": CRAWLER, "worm_hanger": HANGER}
"""Worms that go by a name, for policies to drive."""


def build_worm(config: WormConfig | None = None) -> mujoco.MjSpec:
    """Specification of a worm.

    Bodies "Segment1" (the head) to "Segment{N}", each the child of the one before and with its
    origin at its front end; there is the joint, "joint_1" to "joint_{N-1}", that ties it to the
    segment before. A positive angle about y bends the tail to the back, one about z to the right.

    Muscles are sites of a body "muscles", which `flyrl.muscles.attach_muscles` turns into
    actuators: "Muscle{i}_dorsal" and "Muscle{i}_ventral", or "Muscle{i}_left" and
    "Muscle{i}_right", act on the segment behind joint i. A muscle's y axis is the one about which
    the segment moves towards the muscle, so those of antagonists are opposite.

    Only a crawling worm touches something: planes with contype `PLANES`, with a foot under the
    middle of each segment: geoms "Foot1" to "Foot{N}", capsules that are tilted a little, so that
    only one end touches. It has the joints `CRAWLING_ROOT` at its head. MuJoCo aligns the
    contact of a capsule with a plane with the capsule's axis. But friction that differs along and
    across it takes an explicit pair of the two geoms (`flyrl.simulation.scene`); without, that
    along the segment holds in all directions.

    Parameters
    ----------
    config : which worm; the default one if not given.
    """
    config = config or WormConfig()
    spec = mujoco.MjSpec()
    spec.modelname = "worm"
    spec.compiler.degree = False
    spec.option.gravity = (0.0, 0.0, 0.0) if config.mount == "suspended" else GRAVITY
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    crawls = config.mount == "crawling"
    quats = {"hanging": _HEAD_UP, "suspended": _HEAD_DOWN, "crawling": (1.0, 0.0, 0.0, 0.0)}
    pose = {"pos": (0.0, 0.0, config.radius if crawls else 0.0), "quat": quats[config.mount]}
    muscles = spec.worldbody.add_body(name="muscles", **pose)
    body = spec.worldbody.add_body(name="Segment1", **pose)
    if crawls:
        for name, axis in zip(CRAWLING_ROOT[:3], np.eye(3), strict=True):
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_joint(name=CRAWLING_ROOT[3], type=mujoco.mjtJoint.mjJNT_HINGE, axis=_AXES["z"])
    _add_segment(body, config, 1)
    for joint in range(1, config.segments):
        body = body.add_body(name=f"Segment{joint + 1}", pos=(-config.segment_length, 0.0, 0.0))
        _add_joint(body, config, joint)
        _add_segment(body, config, joint + 1)
        _add_muscles(spec, muscles, config, joint)
    length = config.segments * config.segment_length
    set_look(spec, extent=length, ambient=0.35, diffuse=0.35, specular=0.1)
    place, direction = (0.0, -length, length), (0.3, 0.6, -0.7)
    add_sun(spec.worldbody, place, direction, (0.5, 0.48, 0.45), False)
    return spec


def _add_segment(body: mujoco.MjsBody, config: WormConfig, segment: int) -> None:
    body.add_geom(
        name=f"Segment{segment}",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(0.0, 0.0, 0.0, -config.segment_length, 0.0, 0.0),
        size=(config.radius, 0.0, 0.0),
        density=config.density,
        rgba=_SKINS[segment % len(_SKINS)],
        contype=0,
        conaffinity=0,
    )
    if config.mount == "crawling":
        _add_foot(body, config, segment)


def _add_foot(body: mujoco.MjsBody, config: WormConfig, segment: int) -> None:
    """Add what touches the ground under a segment's middle; it has no mass."""
    middle = -config.segment_length / 2
    front = middle + _FOOT_LENGTH * config.radius
    body.add_geom(
        name=f"Foot{segment}",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(front, 0.0, _FOOT_RISE * config.radius, middle, 0.0, 0.0),
        size=(config.radius, 0.0, 0.0),
        mass=0.0,
        group=COLLISION_GROUP,
        contype=0,
        conaffinity=PLANES,
        # its own contact counts, not a mean of its and the ground's
        priority=1,
        condim=3,
        friction=(config.friction_along, 0.005, 0.0001),
        solref=FOOT_SOLREF,
        solimp=FOOT_SOLIMP,
    )


def _add_joint(body: mujoco.MjsBody, config: WormConfig, joint: int) -> None:
    hinge = body.add_joint(
        name=f"joint_{joint}",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=_AXES[config.axis(joint)],
        limited=True,
        range=(-config.joint_range, config.joint_range),
        solref_limit=JOINT_LIMIT_SOLREF,
    )
    hinge.stiffness[0] = config.joint_stiffness
    hinge.damping[0] = config.joint_damping


def _add_muscles(
    spec: mujoco.MjSpec, muscles: mujoco.MjsBody, config: WormConfig, joint: int
) -> None:
    """Add the muscles of a joint over the middle of the segment behind it."""
    sides = _SIDES[config.axis(joint)]
    if config.muscles == "one":
        sides = sides[:1] if joint == config.joints else ()
    middle = np.array((-(joint + 0.5) * config.segment_length, 0.0, 0.0))
    for side, direction, quat in sides:
        name = f"Muscle{joint}_{side}"
        muscles.add_site(
            name=name,
            pos=middle + MUSCLE_HEIGHT * config.radius * np.array(direction),
            quat=quat,
            size=(0.4 * config.radius, 0.0, 0.0),
            rgba=_MUSCLE_COLOUR,
        )
        spec.add_text(name=f"{name}/profile", data=config.profile_path.name)
        spec.add_numeric(name=f"{name}/strength", data=[config.strength], size=1)
        if config.anchored:
            spec.add_text(name=f"{name}/anchor", data=f"Segment{joint}")
