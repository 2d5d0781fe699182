import mujoco
import numpy as np
import pytest

from flyrl.bodies.fly import build_fly
from flyrl.bodies.surface import ContactConfig, SurfaceContact
from flyrl.simulation.scene import (
    SceneConfig,
    build_scene,
    drop_idle_shapes,
    pair_with_planes,
)
from flyrl.terrains import TERRAINS, add_terrain

CONTACT = ContactConfig(
    plane=SurfaceContact(
        friction=(0.7, 0.01, 0.001),
        solref=(-1e5, -2e3),
        solimp=(0.9, 0.95, 0.002, 0.4, 1.0),
        condim=4,
        margin=0.02,
    )
)


def fly_on(terrain):
    spec = build_fly(contact=CONTACT, visual=False)
    add_terrain(spec, TERRAINS[terrain])
    return spec


def posed(spec, height):
    """A fly in its zero pose."""
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("root").qpos[2] = height
    mujoco.mj_forward(model, data)
    return model, data


def contacts_of(spec, height):
    """Sorted by place."""
    return sorted(posed(spec, height)[1].contact, key=lambda contact: tuple(contact.pos))


@pytest.mark.parametrize(
    ("terrain", "to_planes", "to_boxes"),
    [("flat", 48, 0), ("gapped", 48, 48), ("blocks", 0, 48), ("mixed", 48, 48)],
)
def test_legs_keep_the_shapes_that_the_ground_calls_for(terrain, to_planes, to_boxes):
    spec = fly_on(terrain)
    drop_idle_shapes(spec)
    names = [geom.name for geom in spec.geoms]
    assert sum(name.endswith("_plane") for name in names) == to_planes
    assert sum(name.endswith("_box") for name in names) == to_boxes


@pytest.mark.parametrize(("terrain", "height"), [("flat", 0.5), ("gapped", -0.5), ("mixed", 0.4)])
def test_pairs_give_the_contacts_that_contact_bits_give(terrain, height):
    by_bits = contacts_of(fly_on(terrain), height)
    paired = fly_on(terrain)
    pair_with_planes(paired)
    by_pairs = contacts_of(paired, height)
    assert len(by_bits) == len(by_pairs) > 0
    for ours, theirs in zip(by_pairs, by_bits, strict=True):
        assert ours.dim == theirs.dim
        for figure in ("pos", "frame", "dist", "friction", "solref", "solimp", "includemargin"):
            np.testing.assert_array_equal(getattr(ours, figure), getattr(theirs, figure), figure)


def test_every_plane_is_left_to_pairs_with_friction_across_along_the_second_tangent():
    spec = fly_on("flat")
    ledge = {"name": "ledge", "type": mujoco.mjtGeom.mjGEOM_PLANE, "size": (1, 1, 1)}
    spec.worldbody.add_geom(**ledge, contype=1, conaffinity=0)
    pair_with_planes(spec, friction_across=0.4)
    assert len(spec.pairs) == 2 * 48
    assert {spec.geom(name).contype for name in ("ground", "ledge")} == {0}
    assert {geom.conaffinity for geom in spec.geoms} == {0, 2}
    _, data = posed(spec, 0.5)
    assert data.ncon > 0
    for contact in data.contact:
        np.testing.assert_array_equal(contact.friction, [0.7, 0.4, 0.01, 0.001, 0.001])
        axis = data.geom_xmat[contact.geom2].reshape(3, 3)[:, 2]
        assert abs(contact.frame.reshape(3, 3)[2] @ axis) < 1e-12


def test_a_scene_that_is_built_again_has_a_model_of_its_own():
    for _ in range(2):
        first, again = build_scene(SceneConfig()), build_scene(SceneConfig())
        first.model.body_mass[:] = 0.0
        assert again.model.body_mass.any()
