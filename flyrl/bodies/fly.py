"""The fly as a MuJoCo model specification.

Body "Thorax" is the root: x forward, y to the fly's left, z up, the same in both bodies (the
published current model hangs the thorax, unrotated, below a body "FlyBody" that only moves the
origin; it is left out here). Units mm, g, s, rad; forces in µN.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import END_EFFECTORS, JOINTS, LEG_SEGMENTS, LEGS, Leg
from flyrl.bodies.surface import (
    GRAVITY,
    VISUAL_GROUP,
    ContactConfig,
    add_material,
    add_sun,
    set_look,
    touching,
)
from flyrl.bodies.table import (
    REFLECTION,
    BodyName,
    BodyRow,
    BodyTable,
    body_table,
    leg_collision,
    stretch_degrees,
    symmetric_table,
)
from flyrl.resources import assets_folder, muscle_profile, recorded_profile
from flyrl.validation import Within, check_fields, distinct, one_of, within

ROOT_BODY: Final = "Thorax"
ROOT_JOINT: Final = "root"

SERVO_ARMATURE: Final = 2e-8
"""Inertia of a servo about its joint, g mm²: a thousandth of a leg's about its coxa.

The published models have none. There a coxa whose pitch lines up the axes of yaw and roll (gimbal
lock) has a singular inertia matrix, and MuJoCo takes an acceleration beyond 1e10 rad/s² for an
explosion. Damping, which counts for 300 times as much in a step of 1e-4 s, decides how the joint
moves either way.
"""

PASSIVE_ARMATURE: Final = 1e-10
"""Inertia of any other joint, g mm²: a third of what the tip of a tarsus resists with.

The published models have none, and their tips come near 1e10 rad/s² too. More of it gives feet a
better grip with the literature's integrator, which stops flies on blocks: a joint's inertia over
its damping in a step is the share of a foot's slip that it corrects in this step.
"""

GHOST: Final = 1e-3
"""Share of its mass that a leg which was cut off keeps: without any, joints could not be solved."""

FIXED_SOLREF: Final = (2e-3, 1.0)
FIXED_SOLIMP: Final = (0.99, 0.999, 1e-3, 0.5, 2.0)
"""Of joints that cannot move: back in place within some ms, and stiffer than servos and ground."""

PLANES: Final = 1
BOXES: Final = 2
"""Contact bits of the ground's planes and boxes; a leg segment has a shape per kind it touches."""
PROPS: Final = 4
"""Contact bit of solid props, which stop the trunk too."""

Point = tuple[float, float, float]
Capsule = tuple[Point, Point, float]
"""Ends and radius, mm, thorax frame."""

TRUNK: Final[Capsule] = ((-1.2, 0.0, 0.0), (0.3, 0.0, 0.0), 0.4)
"""Stands for thorax, head and abdomen."""

ABDOMEN: Final[Capsule] = ((-1.0, 0.0, -0.1), (-1.75, 0.0, -0.5), 0.38)
HEAD: Final[Capsule] = ((0.28, 0.0, 0.0), (0.28, 0.0, -0.2), 0.35)
"""What the classic abdomen, and its head with the proboscis, are to the ground; underneath, to
0.13 mm the hulls of the meshes."""

TETHER: Final = 1e3
"""g (and g·mm²): inertia that holds the thorax, a million times the fly's; it has no weight."""


@dataclass(frozen=True)
class LegMuscles:
    """Muscles that move the legs: at each of the 42 joints a pair, one muscle for either way.

    Attributes
    ----------
    profile : motor pool of every muscle: the name of an image in assets/muscles, or the path of
        one of your own, see `flyrl.muscles.MotorPool.from_image`.
    order : whether its neurons are recruited as in the image or, "reversed", the last one first.
    strength : torque of a muscle with all neurons active, µN·mm.
    left, right : factors on the strength of the muscles of a side.
    """

    profile: str = "human"
    order: Literal["profile", "reversed"] = "profile"
    strength: Annotated[float, Within(0, 1e4)] = 15.0
    left: Annotated[float, Within(0, 100)] = 1.0
    right: Annotated[float, Within(0, 100)] = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "muscles")
        object.__setattr__(self, "profile", recorded_profile("muscles.profile", self.profile))

    @property
    def profile_path(self) -> Path:
        """Image of every muscle's motor pool."""
        return muscle_profile("muscles.profile", self.profile)


@dataclass(frozen=True)
class FlyConfig:
    """Which fly.

    Attributes
    ----------
    name : "current" (coxa joints yaw, pitch, roll; goes with the untethered step) or "classic"
        (roll, yaw, pitch; goes with the tethered step).
    adhesion_gain : force of a fully gripping leg tip, µN.
    rigid_head : weld the head to the thorax, and the antennae to the head, which saves 21 joints
        that have no part in walking. The published models let them swing.
    symmetric : make left and right exact mirror images (see `table.symmetric_table`). The
        published models are slightly lopsided; take False to have them as they are.
    missing_legs : legs that are cut off. They keep their joints, so that every array has its usual
        shape, but weigh next to nothing, touch nothing and are not seen.
    fixed_joints : joints that cannot move, each a name in anatomy.JOINTS and its angle, rad.
    senses_contact : False silences the legs' sense of contact, of which stumbling and the
        observed contacts and forces come.
    muscles : what moves the legs' joints instead of servos; None for servos.
    tethered : hold the thorax where the fly is put down, for legs in the air or on a ball (see
        `terrains.Air` and `terrains.Ball`).
    """

    simulated_by: ClassVar[str] = "flyrl.simulation.flies:FlyBatch"

    name: BodyName = "current"
    adhesion_gain: Annotated[float, Within(0, 1e4)] = 40.0
    rigid_head: bool = True
    symmetric: bool = True
    missing_legs: tuple[Leg, ...] = ()
    fixed_joints: tuple[tuple[str, float], ...] = ()
    senses_contact: bool = True
    muscles: LegMuscles | None = None
    tethered: bool = False

    def __post_init__(self) -> None:
        check_fields(self, "body")
        distinct("body.missing_legs", self.missing_legs)
        distinct("body.fixed_joints", [joint for joint, _ in self.fixed_joints])
        for joint, angle in self.fixed_joints:
            one_of("body.fixed_joints", joint, JOINTS)
            within(f"body.fixed_joints: angle of {joint}", angle, -math.pi, math.pi)

    @property
    def profile_path(self) -> Path | None:
        """Image of the muscles' motor pool, of a fly that has muscles."""
        return None if self.muscles is None else self.muscles.profile_path


FLIES: Final[Mapping[str, FlyConfig]] = {
    "current": FlyConfig(),
    "classic": FlyConfig(name="classic"),
    "fly_muscles": FlyConfig(muscles=LegMuscles()),
    "tethered": FlyConfig(tethered=True),
}
"""Flies by name: choices of the group `body`."""


def build_fly(
    config: FlyConfig | None = None,
    contact: ContactConfig | None = None,
    visual: bool = True,
) -> mujoco.MjSpec:
    """Specification of a fly that floats freely, with its actuators.

    Actuators, in order: 42 position servos `actuator_{joint}` as anatomy.JOINTS, whose control is
    an angle in rad, or with muscles motors, whose control is a torque in µN·mm; then 6 adhesions
    `adhesion_{leg}` as anatomy.LEGS, whose control is 0 to 1.

    Leg segments can touch the ground (planes with contype `PLANES`, boxes with contype `BOXES`,
    conaffinity 0), of the classic body abdomen and head too: so do the published models. (Both also
    let legs collide with each other; here legs pass through each other.)

    Parameters
    ----------
    config : which fly; the current one by default.
    contact : contact parameters of the legs; the literature's by default.
    visual : with meshes to look at. Without, the model compiles faster and moves the same.
    """
    config = config or FlyConfig()
    contact = contact or ContactConfig()
    table = _table(config)
    spec = mujoco.MjSpec()
    spec.modelname = f"fly_{config.name}"
    spec.compiler.degree = False
    spec.option.gravity = GRAVITY
    set_look(spec, extent=5.0, ambient=0.3, diffuse=0.25, specular=0.05)
    for row in table.bodies:
        is_missing = is_of_legs(row.name, config.missing_legs)
        body = _add_body(spec, row, config.rigid_head, GHOST if is_missing else 1.0)
        if is_missing:
            continue
        if (shape := leg_collision().get(f"R{row.name[1:]}")) is not None:
            _add_collision(spec, body, shape, contact)
        if visual and row.mesh is not None:
            _add_mesh(spec, body, **row.mesh)
    if config.name == "classic":
        _add_capsule(spec, "abdomen", ABDOMEN, PLANES | BOXES, contact)
        _add_capsule(spec, "head", HEAD, PLANES | BOXES, contact)
    _add_actuators(spec, table, config)
    _fix_joints(spec, config)
    if config.tethered:
        spec.joint(ROOT_JOINT).armature = TETHER
    # overhead, over the fly's middle: under a slanting light the ground shadows itself in speckles,
    # where the drawn shadows end
    add_sun(spec.body(ROOT_BODY), (-0.5, 0.0, 9.6), (0.0, 0.0, -1.0), (0.6, 0.58, 0.54), True)
    return spec


def is_of_legs(body: str, legs: Sequence[Leg]) -> bool:
    """Whether a body, by its name, is part of one of these legs; the classic coxa is three."""
    return body.startswith(tuple(leg + segment for leg in legs for segment in LEG_SEGMENTS))


def add_trunk(spec: mujoco.MjSpec, contact: ContactConfig) -> None:
    """Let the trunk of a fly touch solid props, as its legs do."""
    _add_capsule(spec, "trunk", TRUNK, PROPS, contact)


def start_pose(config: FlyConfig) -> NDArray[np.float64]:
    """Pose in which a fly starts: the stretch pose, but for joints that cannot move, (42,) rad."""
    pose = stretch_pose()
    for joint, angle in config.fixed_joints:
        pose[JOINTS.index(joint)] = angle
    return pose


def stretch_pose() -> NDArray[np.float64]:
    """Starting pose with the legs stretched out sideways, (42,) rad, ordered as anatomy.JOINTS.

    From the published package's pose file; the same for both bodies.
    """
    return np.radians([stretch_degrees()[joint] for joint in JOINTS])


def spawn_offset(config: FlyConfig) -> NDArray[np.float64]:
    """Position of the thorax when the fly is placed at the origin facing +x, (3,) mm.

    The published packages place a frame on the ground below the fly's tail, not the thorax. Add
    this to their spawn positions to get the same start.
    """
    return np.array(_table(config).thorax_in_spawn_frame)


def _table(config: FlyConfig) -> BodyTable:
    table = body_table(config.name)
    return symmetric_table(table) if config.symmetric else table


def _add_body(spec: mujoco.MjSpec, row: BodyRow, rigid_head: bool, share: float) -> mujoco.MjsBody:
    """Add a body with a share of its mass, and its joints."""
    parent = spec.worldbody if row.parent is None else spec.body(row.parent)
    body = parent.add_body(
        name=row.name,
        pos=row.pos,
        quat=row.quat,
        mass=share * row.mass,
        ipos=row.ipos,
        iquat=row.iquat,
        inertia=share * np.array(row.inertia),
        explicitinertial=True,
    )
    if row.parent is None:
        body.add_freejoint(name=ROOT_JOINT)
    if rigid_head and not is_of_legs(row.name, LEGS):
        return body
    for joint in row.joints:
        hinge = body.add_joint(
            name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis, pos=joint.pos
        )
        hinge.stiffness[0] = joint.stiffness
        hinge.damping[0] = joint.damping
        hinge.armature = SERVO_ARMATURE if joint.name in JOINTS else PASSIVE_ARMATURE
    return body


def _add_collision(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: dict[str, Any], contact: ContactConfig
) -> None:
    """Add the shapes of a leg segment: a hull for boxes, and what `contact` says for planes."""
    sign = np.array(REFLECTION if body.name.startswith("L") else (1.0, 1.0, 1.0))
    spec.add_mesh(
        name=f"{body.name}_hull",
        uservert=(shape["hull"]["vertices"] * sign).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    hull = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": f"{body.name}_hull"}
    capsule = {
        "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
        "fromto": np.ravel([shape["capsule"]["from"] * sign, shape["capsule"]["to"] * sign]),
        "size": (shape["capsule"]["radius"], 0, 0),
    }
    if body.name.endswith(contact.plane_segments):
        to_planes = {"capsule": capsule, "hull": hull}[contact.plane_shape]
        body.add_geom(name=f"{body.name}_plane", **to_planes, **touching(PLANES, contact.plane))
    body.add_geom(name=f"{body.name}_box", **hull, **touching(BOXES, contact.box))


def _add_capsule(
    spec: mujoco.MjSpec, name: str, shape: Capsule, touches: int, contact: ContactConfig
) -> None:
    """Add a part of the trunk, as what it is to the ground or to props."""
    start, end, radius = shape
    spec.body(ROOT_BODY).add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(*start, *end),
        size=(radius, 0, 0),
        **touching(touches, contact.box),
    )


def _add_mesh(spec: mujoco.MjSpec, body: mujoco.MjsBody, file: str, mirrored: bool) -> None:
    spec.add_mesh(
        name=body.name,
        file=str(assets_folder() / "meshes" / f"{file}.stl"),
        scale=(1, -1 if mirrored else 1, 1),
        # Decimated surfaces are not watertight; their volume is never asked for.
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    body.add_geom(
        name=f"{body.name}_visual",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=body.name,
        material=add_material(spec, body.name),
        mass=0,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
    )


def _add_actuators(spec: mujoco.MjSpec, table: BodyTable, config: FlyConfig) -> None:
    for joint, stiffness in zip(JOINTS, servo_stiffness(config), strict=True):
        servo = spec.add_actuator(
            name=f"actuator_{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        if config.muscles is not None:
            servo.set_to_motor()
            continue
        servo.set_to_position(kp=stiffness)
        if table.force_range is not None:
            servo.forcelimited = True
            servo.forcerange = table.force_range
    for leg, tip in zip(LEGS, END_EFFECTORS, strict=True):
        grip = spec.add_actuator(
            name=f"adhesion_{leg}", target=tip, trntype=mujoco.mjtTrn.mjTRN_BODY
        )
        grip.set_to_adhesion(gain=config.adhesion_gain)
        grip.ctrllimited = True
        grip.ctrlrange = (0.0, 1.0)


def servo_stiffness(config: FlyConfig) -> NDArray[np.float64]:
    """Stiffness of the servos, or of those that muscles stand in for, µN·mm/rad, (42,).

    Those of joints that cannot move, which could do nothing, are still.
    """
    stiffness = body_table(config.name).kp
    fixed = {joint for joint, _ in config.fixed_joints}
    return np.array([0.0 if joint in fixed else stiffness for joint in JOINTS])


def _fix_joints(spec: mujoco.MjSpec, config: FlyConfig) -> None:
    """Hold joints at their angles."""
    for joint, angle in config.fixed_joints:
        data = np.zeros(mujoco.mjNEQDATA)
        data[0] = angle
        spec.add_equality(
            name=f"fixed_{joint}",
            type=mujoco.mjtEq.mjEQ_JOINT,
            name1=joint,
            data=data,
            solref=FIXED_SOLREF,
            solimp=FIXED_SOLIMP,
        )
