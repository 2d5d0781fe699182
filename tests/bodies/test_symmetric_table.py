"""The symmetric body, part by part; tests/simulation/test_symmetry.py lets it walk."""

from typing import get_args

import mujoco
import numpy as np
import pytest

from flyrl.anatomy import JOINTS, RIGHT_LEG_MIRROR
from flyrl.bodies.fly import FlyConfig, build_fly
from flyrl.bodies.table import BodyName, body_table, symmetric_table

pytestmark = pytest.mark.parametrize("name", get_args(BodyName))

REFLECTION = np.diag([1.0, -1.0, 1.0])


def posed(name, angles):
    model = build_fly(FlyConfig(name, rigid_head=False), visual=False).compile()
    data = mujoco.MjData(model)
    for joint, angle in zip(JOINTS, angles, strict=True):
        data.joint(joint).qpos = angle
    mujoco.mj_forward(model, data)
    return model, data


def twin(model, body):
    """Name of the body on the other side, or of a midline body itself."""
    other = {"L": "R", "R": "L"}.get(body[0], body[0]) + body[1:]
    return other if other in {model.body(i).name for i in range(model.nbody)} else body


def inertia_w(model, data, body):
    axes = data.ximat[body].reshape(3, 3)
    return axes @ np.diag(model.body_inertia[body]) @ axes.T


def test_mirrored_angles_give_the_mirror_image(name):
    """Masses, centres of mass, inertia tensors and places, in a pose drawn at random."""
    angles = np.random.default_rng(1).uniform(-1, 1, 42)
    model, data = posed(name, angles)
    _, image = posed(name, (angles.reshape(2, 3, 7)[::-1] * RIGHT_LEG_MIRROR).ravel())
    for body in range(1, model.nbody):
        other = model.body(twin(model, model.body(body).name)).id
        assert model.body_mass[body] == model.body_mass[other]
        np.testing.assert_allclose(image.xpos[other], REFLECTION @ data.xpos[body], atol=1e-12)
        np.testing.assert_allclose(image.xipos[other], REFLECTION @ data.xipos[body], atol=1e-12)
        tensor = inertia_w(model, data, body)
        np.testing.assert_allclose(
            inertia_w(model, image, other),
            REFLECTION @ tensor @ REFLECTION,
            rtol=0,
            atol=1e-12 * np.trace(tensor),
        )


def test_symmetry_moves_little(name):
    """The right side not at all, the midline by less than 0.01 mm, inertia by less than 1 %."""
    published = body_table(name)
    for row, before in zip(symmetric_table(published).bodies, published.bodies, strict=True):
        if row.name[0] == "R" and row.name != "Rostrum":
            assert row == before
        elif row.name[0] != "L":
            np.testing.assert_allclose(row.pos, before.pos, rtol=0, atol=0.01)
            np.testing.assert_allclose(row.ipos, before.ipos, rtol=0, atol=0.01)
            assert row.mass == before.mass
            np.testing.assert_allclose(
                sorted(row.inertia), sorted(before.inertia), rtol=0, atol=0.01 * max(row.inertia)
            )
