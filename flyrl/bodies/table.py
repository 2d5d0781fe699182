"""The figures of a body, as read from `assets/bodies` and `assets/collision`.

Lengths in mm, masses in g, angles in rad, so torques come out in µN·mm. Source: NeuroMechFly
(doi:10.1038/s41592-022-01466-7, doi:10.1038/s41592-024-02497-y); see assets/README.md.
"""

import functools
import json
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

from flyrl.resources import assets_folder

BodyName = Literal["current", "classic"]
BODY_NAMES: Final[tuple[BodyName, ...]] = get_args(BodyName)

Vector = tuple[float, ...]


@dataclass(frozen=True)
class JointRow:
    """A hinge: axis and anchor in the body's frame, passive spring and damper."""

    name: str
    axis: Vector
    pos: Vector
    stiffness: float
    damping: float


@dataclass(frozen=True)
class BodyRow:
    """A body: pose in its parent, inertia as compiled from the published model, joints in order.

    `parent` is None for the thorax. `mesh` is the name of a file in assets/meshes, to be reflected
    at the x-z plane if `mesh_mirrored`; None for a body that only carries a joint.
    """

    name: str
    parent: str | None
    pos: Vector
    quat: Vector
    mass: float
    ipos: Vector
    iquat: Vector
    inertia: Vector
    joints: tuple[JointRow, ...]
    mesh: str | None
    mesh_mirrored: bool


@dataclass(frozen=True)
class BodyTable:
    """All figures of one body.

    `thorax_in_spawn_frame` (mm) leads from the frame in which the published package places the fly
    (on the ground below the tail, x forward) to the thorax.
    """

    name: str
    coxa_joint_order: tuple[str, ...]
    recorded_step: str
    thorax_in_spawn_frame: Vector
    kp: float
    force_range: tuple[float, float] | None
    adhesion_gain: float
    bodies: tuple[BodyRow, ...]


@dataclass(frozen=True)
class CollisionRow:
    """Collision shapes of a leg segment, in the body's frame, mm.

    Attributes
    ----------
    start, end, radius : of the capsule: centres of its caps, and radius.
    vertices : of the convex hull.
    """

    segment: str
    start: Vector
    end: Vector
    radius: float
    vertices: tuple[Vector, ...]


def _read(path: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((assets_folder() / path).read_text(encoding="utf-8"))
    return content


def _body_row(row: dict[str, Any]) -> BodyRow:
    joints = tuple(
        JointRow(j["name"], tuple(j["axis"]), tuple(j["pos"]), j["stiffness"], j["damping"])
        for j in row["joints"]
    )
    mesh = row["mesh"] or {"file": None, "mirrored": False}
    return BodyRow(
        name=row["name"],
        parent=row["parent"],
        pos=tuple(row["pos"]),
        quat=tuple(row["quat"]),
        mass=row["mass"],
        ipos=tuple(row["ipos"]),
        iquat=tuple(row["iquat"]),
        inertia=tuple(row["inertia"]),
        joints=joints,
        mesh=mesh["file"],
        mesh_mirrored=mesh["mirrored"],
    )


@functools.cache
def body_table(name: BodyName) -> BodyTable:
    """Figures of the body called `name`; parents come before their children."""
    content = _read(f"bodies/{name}.json")
    actuators = content["actuators"]
    limits = actuators["force_range"]
    return BodyTable(
        name=content["name"],
        coxa_joint_order=tuple(content["coxa_joint_order"]),
        recorded_step=content["recorded_step"],
        thorax_in_spawn_frame=tuple(content["thorax_in_spawn_frame"]),
        kp=actuators["kp"],
        force_range=None if limits is None else (limits[0], limits[1]),
        adhesion_gain=actuators["adhesion_gain"],
        bodies=tuple(_body_row(row) for row in content["bodies"]),
    )


@functools.cache
def leg_collision() -> tuple[CollisionRow, ...]:
    """Collision shapes of the 24 leg segments of the right side; both bodies have the same."""
    return tuple(
        CollisionRow(
            segment=row["segment"],
            start=tuple(row["capsule"]["from"]),
            end=tuple(row["capsule"]["to"]),
            radius=row["capsule"]["radius"],
            vertices=tuple(tuple(vertex) for vertex in row["hull"]["vertices"]),
        )
        for row in _read("collision/legs.json")["segments"]
    )


@functools.cache
def pose_degrees(name: str) -> dict[str, float]:
    """Joint angles of a stored pose, degrees by joint name. Only "stretch" is stored."""
    angles: dict[str, float] = _read(f"poses/{name}.json")["angles"]
    return angles
