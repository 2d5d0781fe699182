"""Which body of a model a site is nearest to, and where the site is in a body's frame."""

from typing import Final, NamedTuple

import mujoco
import numpy as np

from flyrl.validation import FloatArray

_PROBE_RADIUS: Final = 1e-6
"""Of the sphere with which distances are measured, in the model's unit."""

_TIE: Final = 1e-6
"""Share of the model's extent by which one distance has to be smaller than another."""

_FARTHEST: Final = 1e6
"""How far distances are measured, in extents of the model."""


class Place(NamedTuple):
    """Where a site comes to stand: its body, position and turn in the body's frame, and its size.

    Bodies are numbers in the model's order, 0 the world.
    """

    body: int
    pos: FloatArray
    quat: FloatArray
    size: FloatArray


class Measured(NamedTuple):
    """A model in its initial pose, to take measures of; its probe is a tiny sphere."""

    model: mujoco.MjModel
    data: mujoco.MjData
    probe: int


def measuring_model(spec: mujoco.MjSpec) -> Measured:
    """Compile a copy whose bodies have the order and frames of the specification."""
    copy = spec.copy()
    copy.compiler.fusestatic = False
    copy.compiler.alignfree = False
    for joint in copy.joints:
        joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    probe = copy.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(_PROBE_RADIUS, 0, 0), mass=0
    )
    model = copy.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return Measured(model, data, probe.id)


def place_on(measured: Measured, site: int, body: int) -> Place:
    """Place of `site` in the frame of `body`, so that it stays where it is in the world."""
    model, data, _ = measured
    quats = np.empty((3, 4))
    mujoco.mju_mat2Quat(quats[0], data.site_xmat[site])
    mujoco.mju_negQuat(quats[1], data.xquat[body])
    mujoco.mju_mulQuat(quats[2], quats[1], quats[0])
    offset_w = data.site_xpos[site] - data.xpos[body]
    pos = data.xmat[body].reshape(3, 3).T @ offset_w
    return Place(body, pos, quats[2], model.site_size[site])


def nearest_body(measured: Measured, site: int) -> int | None:
    """Body from whose surface `site` is the least way off, the first of several; None without."""
    model, data, probe = measured
    data.geom_xpos[probe] = data.site_xpos[site]
    extent = float(model.stat.extent)
    nearest, least = None, _FARTHEST * extent
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body == 0:
            continue
        distance = mujoco.mj_geomDistance(model, data, probe, geom, _FARTHEST * extent, None)
        if distance < least - _TIE * extent:
            nearest, least = body, distance
    return nearest
