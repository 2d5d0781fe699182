"""The figures of a body, as read from `assets/bodies` and `assets/collision`, and made symmetric.

Lengths in mm, masses in g, angles in rad, so torques come out in µN·mm. Source: NeuroMechFly
(doi:10.1038/s41592-022-01466-7, doi:10.1038/s41592-024-02497-y); see assets/README.md.
"""

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from flyrl.resources import assets_folder

BodyName = Literal["current", "classic"]

Vector = Sequence[float]


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

    `parent` is None for the thorax. `mesh` has the name of a "file" in assets/meshes, which is
    reflected at the x-z plane if "mirrored"; None for a body that only carries a joint.
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
    mesh: dict[str, Any] | None


@dataclass(frozen=True)
class BodyTable:
    """All figures of one body.

    `thorax_in_spawn_frame` (mm) leads from the frame in which the published package places the fly
    (on the ground below the tail, x forward) to the thorax.
    """

    thorax_in_spawn_frame: Vector
    kp: float
    force_range: Vector | None
    bodies: tuple[BodyRow, ...]


def _read(path: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((assets_folder() / path).read_text(encoding="utf-8"))
    return content


@functools.cache
def body_table(name: BodyName) -> BodyTable:
    """Figures of the body called `name`; parents come before their children."""
    content = _read(f"bodies/{name}.json")
    return BodyTable(
        thorax_in_spawn_frame=content["thorax_in_spawn_frame"],
        kp=content["actuators"]["kp"],
        force_range=content["actuators"]["force_range"],
        bodies=tuple(
            BodyRow(**{**row, "joints": tuple(JointRow(**joint) for joint in row["joints"])})
            for row in content["bodies"]
        ),
    )


@functools.cache
def leg_collision() -> dict[str, dict[str, Any]]:
    """Collision shapes of the 24 leg segments of the right side, the same in both bodies.

    By segment: "capsule", "from" and "to" the centres of its caps, with a "radius"; and "hull", a
    convex one of "vertices". In the body's frame, mm.
    """
    return {row["segment"]: row for row in _read("collision/legs.json")["segments"]}


@functools.cache
def stretch_degrees() -> dict[str, float]:
    """Angles of the stretch pose, degrees by joint name."""
    angles: dict[str, float] = _read("poses/stretch.json")["angles"]
    return angles


# ------------------------------------------------------------------ symmetry


REFLECTION: Final = (1.0, -1.0, 1.0)
"""Sign of a vector's components under reflection."""

QUATERNION_REFLECTION: Final = (1.0, -1.0, 1.0, -1.0)
"""Sign of a quaternion's components (w, x, y, z) when diag(REFLECTION) conjugates its rotation."""


def symmetric_table(table: BodyTable) -> BodyTable:
    """Make a body the exact mirror image of itself.

    The published bodies are slightly lopsided: the scan puts the centres of mass of the midline's
    bodies 0.003 to 0.009 mm to the left, and left and right differ in the last digits (in the
    classic body's legs, by up to 0.03 mm).

    - A left body becomes the mirror image of the right one, whose mesh both sides share.
    - A midline body loses what is not symmetric: the y of its position and centre of mass, its
      rotation about any axis but y, and its products of inertia with y.
    - Hinges keep their axes, all of them along x, y or z: reflected, a turn about y stays and one
      about x or z changes its sign, as `anatomy.RIGHT_LEG_MIRROR` says.
    """
    rows = {row.name: row for row in table.bodies}
    x, _, z = table.thorax_in_spawn_frame
    return replace(
        table,
        thorax_in_spawn_frame=(x, 0.0, z),
        bodies=tuple(_symmetric_row(row, rows) for row in table.bodies),
    )


def _symmetric_row(row: BodyRow, rows: dict[str, BodyRow]) -> BodyRow:
    side, rest = row.name[0], row.name[1:]
    if side == "R" and f"L{rest}" in rows:
        return row
    if side == "L" and f"R{rest}" in rows:
        return _mirror_image(rows[f"R{rest}"], of=row)
    return _flattened(row)


def _mirror_image(right: BodyRow, of: BodyRow) -> BodyRow:
    """The left body `of` with the figures of its reflected twin."""
    return replace(
        of,
        pos=_signed(right.pos, REFLECTION),
        quat=_signed(right.quat, QUATERNION_REFLECTION),
        mass=right.mass,
        ipos=_signed(right.ipos, REFLECTION),
        iquat=_signed(right.iquat, QUATERNION_REFLECTION),
        inertia=right.inertia,
        joints=tuple(
            replace(twin, name=joint.name, axis=joint.axis, pos=_signed(twin.pos, REFLECTION))
            for joint, twin in zip(of.joints, right.joints, strict=True)
        ),
    )


def _flattened(row: BodyRow) -> BodyRow:
    """The midline body `row` without what reflection would change."""
    w, _, y, _ = row.quat
    iquat, inertia = _flattened_inertia(row)
    return replace(
        row,
        pos=(row.pos[0], 0.0, row.pos[2]),
        quat=(w / np.hypot(w, y), 0.0, y / np.hypot(w, y), 0.0),
        ipos=(row.ipos[0], 0.0, row.ipos[2]),
        iquat=iquat,
        inertia=inertia,
        joints=tuple(replace(joint, pos=(joint.pos[0], 0.0, joint.pos[2])) for joint in row.joints),
    )


def _flattened_inertia(row: BodyRow) -> tuple[Vector, Vector]:
    """Principal axes (a turn about y) and moments of a body's inertia, without products with y."""
    w, x, y, z = row.iquat
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    inertia = axes @ np.diag(row.inertia) @ axes.T
    moment_x, moment_z, product = inertia[0, 0], inertia[2, 2], inertia[0, 2]
    # With this turn about y, the first principal axis has the larger moment of the two.
    angle = 0.5 * np.arctan2(-2 * product, moment_x - moment_z)
    mean = 0.5 * (moment_x + moment_z)
    half_range = np.hypot(0.5 * (moment_x - moment_z), product)
    iquat = (float(np.cos(angle / 2)), 0.0, float(np.sin(angle / 2)), 0.0)
    return iquat, (float(mean + half_range), float(inertia[1, 1]), float(mean - half_range))


def _signed(vector: Vector, signs: Vector) -> Vector:
    return tuple(sign * value for sign, value in zip(signs, vector, strict=True))
