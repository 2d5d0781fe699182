"""What can touch what, said once when a scene is built rather than searched for at every step."""

import itertools

import mujoco
import numpy as np

from flyrl.bodies.fly import PLANES


def drop_idle_shapes(spec: mujoco.MjSpec) -> None:
    """Delete the shapes of legs for a kind of ground or prop that the scene does not have."""
    ground = np.bitwise_or.reduce([geom.contype for geom in spec.geoms])
    for shape in list(spec.geoms):
        if shape.conaffinity and not shape.conaffinity & ground:
            spec.delete(shape)


def pair_with_planes(spec: mujoco.MjSpec, friction_across: float | None = None) -> None:
    """Replace contact bits by explicit pairs wherever a leg can touch a plane.

    Every leg is always near a plane, as MuJoCo's search for neighbours sees it: the search costs a
    twentieth of a step and leaves nothing out. Boxes are many and stay with their contact bits.

    Parameters
    ----------
    spec
        With the ground in it.
    friction_across
        See `ContactConfig.plane_friction_across`; MuJoCo aligns the contact of a capsule with a
        plane with the capsule's axis.
    """
    planes = [geom for geom in spec.geoms if geom.contype & PLANES]
    shapes = [geom for geom in spec.geoms if geom.conaffinity & PLANES]
    for plane, shape in itertools.product(planes, shapes):
        sliding, torsional, rolling = shape.friction
        across = sliding if friction_across is None else friction_across
        # the shape's own figures, as its higher priority had it
        spec.add_pair(
            geomname1=plane.name,
            geomname2=shape.name,
            condim=shape.condim,
            friction=(sliding, across, torsional, rolling, rolling),
            solref=shape.solref,
            solimp=shape.solimp,
            margin=shape.margin,
        )
    for plane in planes:
        plane.contype &= ~PLANES
    for shape in shapes:
        shape.conaffinity &= ~PLANES
