"""What can touch what, said once when a scene is built rather than searched for at every step."""

import itertools

import mujoco


def drop_idle_shapes(spec: mujoco.MjSpec) -> None:
    """Delete the shapes of legs for a kind of ground that the scene does not have."""
    grounds = {ground.contype for ground in spec.worldbody.geoms}
    for shape in _touching_shapes(spec):
        if not any(_touch(ground, shape.conaffinity) for ground in grounds):
            spec.delete(shape)


def pair_with_planes(spec: mujoco.MjSpec) -> None:
    """Replace contact bits by explicit pairs wherever a leg can touch a plane.

    Every leg is always near a plane, as MuJoCo's search for neighbours sees it: the search costs a
    twentieth of a step and leaves nothing out. Boxes are many and stay with their contact bits.
    """
    planes = [
        ground for ground in spec.worldbody.geoms if ground.type == mujoco.mjtGeom.mjGEOM_PLANE
    ]
    for plane, shape in itertools.product(planes, _touching_shapes(spec)):
        if not _touch(plane.contype, shape.conaffinity):
            continue
        sliding, torsional, rolling = shape.friction
        # the shape's own figures, as its higher priority had it
        spec.add_pair(
            geomname1=plane.name,
            geomname2=shape.name,
            condim=shape.condim,
            friction=(sliding, sliding, torsional, rolling, rolling),
            solref=shape.solref,
            solimp=shape.solimp,
            margin=shape.margin,
        )
        shape.conaffinity &= ~plane.contype
    for plane in planes:
        plane.contype = 0


def _touching_shapes(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    return [shape for shape in spec.geoms if shape.conaffinity != 0]


def _touch(contype: int, conaffinity: int) -> bool:
    return contype & conaffinity != 0
