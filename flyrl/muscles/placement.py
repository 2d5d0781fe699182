"""Which body of a model a site is nearest to, and where the site is in a body's frame."""

from typing import Final, NamedTuple

import mujoco
import numpy as np

from flyrl.validation import FloatArray

_PROBE_RADIUS: Final = 1e-6
"""Radius of the sphere with which distances are measured, in the model's unit."""

_TIE: Final = 1e-6
"""Share of the model's extent by which one distance has to be smaller than another."""

_FARTHEST: Final = 1e6
"""Longest distance that is measured, in extents of the model."""


class Place(NamedTuple):
    """Place of a site: its body (0 the world), position and turn in the body's frame, its size."""

    body: int
    pos: FloatArray
    quat: FloatArray
    size: FloatArray


def measuring_model(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile a copy whose bodies have the order and frames of the specification, and pose it.

    Its last geom of the world is a tiny sphere, to measure distances from.
    """
    copy = spec.copy()
    copy.compiler.fusestatic = False
    copy.compiler.alignfree = False
    for joint in copy.joints:
        joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    copy.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(_PROBE_RADIUS, 0, 0), mass=0)
    model = copy.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def place_on(model: mujoco.MjModel, data: mujoco.MjData, site: int, body: int) -> Place:
    """Place of `site` in the frame of `body`, so that it stays where it is in the world."""
    quats = np.empty((3, 4))
    mujoco.mju_mat2Quat(quats[0], data.site_xmat[site])
    mujoco.mju_negQuat(quats[1], data.xquat[body])
    mujoco.mju_mulQuat(quats[2], quats[1], quats[0])
    offset_w = data.site_xpos[site] - data.xpos[body]
    pos = data.xmat[body].reshape(3, 3).T @ offset_w
    return Place(body, pos, quats[2], model.site_size[site])


def nearest_body(model: mujoco.MjModel, data: mujoco.MjData, site: int) -> int | None:
    """Body from whose surface `site` is the least way off, the first of several; None without."""
    probe = int(model.body_geomadr[0] + model.body_geomnum[0] - 1)
    data.geom_xpos[probe] = data.site_xpos[site]
    extent = float(model.stat.extent)
    nearest, least = None, _FARTHEST * extent
    for geom in np.flatnonzero(model.geom_bodyid).tolist():
        distance = mujoco.mj_geomDistance(model, data, probe, geom, _FARTHEST * extent, None)
        if distance < least - _TIE * extent:
            nearest, least = int(model.geom_bodyid[geom]), distance
    return nearest
