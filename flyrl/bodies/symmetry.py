"""Left-right symmetry of a body's table: reflection at the plane y = 0 of the thorax frame."""

import dataclasses
from typing import Final

import numpy as np

from flyrl.bodies.table import BodyRow, BodyTable, JointRow, Vector

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
    return dataclasses.replace(
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
    return dataclasses.replace(
        of,
        pos=_signed(right.pos, REFLECTION),
        quat=_signed(right.quat, QUATERNION_REFLECTION),
        mass=right.mass,
        ipos=_signed(right.ipos, REFLECTION),
        iquat=_signed(right.iquat, QUATERNION_REFLECTION),
        inertia=right.inertia,
        joints=tuple(
            JointRow(
                joint.name,
                joint.axis,
                _signed(twin.pos, REFLECTION),
                twin.stiffness,
                twin.damping,
            )
            for joint, twin in zip(of.joints, right.joints, strict=True)
        ),
    )


def _flattened(row: BodyRow) -> BodyRow:
    """The midline body `row` without what reflection would change."""
    w, _, y, _ = row.quat
    iquat, inertia = _flattened_inertia(row)
    return dataclasses.replace(
        row,
        pos=(row.pos[0], 0.0, row.pos[2]),
        quat=(w / np.hypot(w, y), 0.0, y / np.hypot(w, y), 0.0),
        ipos=(row.ipos[0], 0.0, row.ipos[2]),
        iquat=iquat,
        inertia=inertia,
        joints=tuple(
            dataclasses.replace(joint, pos=(joint.pos[0], 0.0, joint.pos[2]))
            for joint in row.joints
        ),
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
