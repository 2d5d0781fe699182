from typing import NamedTuple, get_args

import mujoco
import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline

from flyrl.anatomy import (
    CONTACT_SEGMENTS,
    JOINTS,
    LEG_DOFS,
    LEG_SEGMENTS,
    LEGS,
    PASSIVE_TARSUS_JOINTS,
)
from flyrl.bodies.fly import FlyConfig, build_fly, stretch_pose
from flyrl.bodies.surface import ContactConfig, SurfaceContact
from flyrl.bodies.table import BodyName, body_table, leg_collision
from flyrl.controllers import Joints
from flyrl.resources import assets_folder
from flyrl.simulation.fly_scene import STEPS_OF_BODY
from flyrl.simulation.physics import PHYSICS_PRESETS
from flyrl.terrains import TERRAINS, Mixed, add_terrain
from tests.simulation.test_callback import make_batch

LEG_BODIES = [f"{leg}{segment}" for leg in LEGS for segment in LEG_SEGMENTS]


@pytest.fixture(scope="module", params=get_args(BodyName))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def model(name):
    return build_fly(FlyConfig(name, symmetric=False), visual=False).compile()


class Published(NamedTuple):
    milligrams: float
    gain: float
    force_limit: float | None
    tarsus_stiffness: float
    tarsus_damping: float


PUBLISHED = {
    "classic": Published(1.0645, 30.0, None, 2.2, 0.05),
    "current": Published(1.0245, 45.0, 65.0, 7.5, 0.01),
}


# ------------------------------------------------------------------ kinematics


def test_forward_kinematics_equals_the_published_model(name, model):
    angles = np.load(assets_folder() / "steps" / f"{STEPS_OF_BODY[name]}.npz")["angles"]
    grid = np.linspace(0, 2 * np.pi, angles.shape[2])
    splines = {
        leg: CubicSpline(grid, recorded, axis=1, bc_type="periodic")
        for leg, recorded in zip(LEGS, angles, strict=True)
    }
    data = mujoco.MjData(model)
    # Somewhere else and turned, so that the thorax frame is not the world frame.
    data.joint("root").qpos = (3.0, -2.0, 1.5, *np.array((0.8, 0.1, -0.2, 0.55)))
    thorax = data.body("Thorax")
    table = pd.read_csv(assets_folder() / "reference" / f"forward_kinematics_{name}.csv")
    assert len(table.groupby(["leg", "phase_rad"])) == 6 * 20
    for row in table.itertuples():
        for dof, angle in zip(LEG_DOFS, splines[row.leg](row.phase_rad), strict=True):
            data.joint(f"joint_{row.leg}{dof}").qpos = angle
        mujoco.mj_kinematics(model, data)
        offset_w = data.body(f"{row.leg}Tarsus5").xpos - thorax.xpos
        position = offset_w @ thorax.xmat.reshape(3, 3)
        np.testing.assert_allclose(position, (row.x, row.y, row.z), rtol=0, atol=0.005)


# ------------------------------------------------------------------ masses


def test_a_fly_weighs_about_a_milligram_part_by_part_as_in_the_table(name, model):
    for row in body_table(name).bodies:
        body = model.body(row.name)
        np.testing.assert_allclose(body.mass, row.mass, rtol=1e-12)
        np.testing.assert_allclose(body.inertia, row.inertia, rtol=1e-12)
        np.testing.assert_allclose(body.ipos, row.ipos, atol=1e-12)
    assert model.body_mass.sum() * 1e3 == pytest.approx(PUBLISHED[name].milligrams, abs=5e-5)


# ------------------------------------------------------------------ joints and actuators


def test_servos_pull_towards_their_control_up_to_their_limit(name, model):
    names = [model.actuator(index).name for index in range(42)]
    assert names == [f"actuator_{joint}" for joint in JOINTS]
    gain, limit = PUBLISHED[name].gain, PUBLISHED[name].force_limit
    np.testing.assert_array_equal(model.actuator_gainprm[:42, 0], gain)
    np.testing.assert_array_equal(model.actuator_biasprm[:42, :3], [[0, -gain, 0]] * 42)
    assert (model.actuator_forcelimited[:42] == (limit is not None)).all()
    if limit is not None:
        np.testing.assert_array_equal(model.actuator_forcerange[:42], [[-limit, limit]] * 42)


def test_adhesion_pulls_a_leg_tip_with_its_gain(model):
    np.testing.assert_array_equal(model.actuator_gainprm[42:, 0], 40.0)
    np.testing.assert_array_equal(model.actuator_ctrlrange[42:], [[0, 1]] * 6)
    for leg, actuator in zip(LEGS, range(42, model.nu), strict=True):
        assert model.actuator(actuator).name == f"adhesion_{leg}"
        assert model.body(model.actuator_trnid[actuator, 0]).name == f"{leg}Tarsus5"
        assert model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_BODY


def test_passive_tarsi_are_springs_and_driven_joints_have_weak_ones(name, model):
    passive = (PUBLISHED[name].tarsus_stiffness, PUBLISHED[name].tarsus_damping)
    for joints, expected in ((PASSIVE_TARSUS_JOINTS, passive), (JOINTS, (0.05, 0.06))):
        for joint in joints:
            index = model.joint(joint).id
            damping = model.dof_damping[model.jnt_dofadr[index]].flat[0]
            assert (model.jnt_stiffness[index].flat[0], damping) == expected


def test_a_head_that_moves_has_21_joints_more():
    """The neck's spring is stiffer than the antennae's; joints without a servo hardly resist."""
    free, rigid = (
        build_fly(FlyConfig("current", rigid_head=rigid), visual=False).compile()
        for rigid in (False, True)
    )
    assert free.nv - rigid.nv == 21
    assert rigid.body_mass.sum() == pytest.approx(free.body_mass.sum(), rel=1e-12)
    assert free.jnt_stiffness[free.joint("joint_Head").id].flat[0] == 10.0
    assert free.jnt_stiffness[free.joint("joint_LArista").id].flat[0] == 1.0
    # with a servo's, a coxa in gimbal lock can still be solved
    names = [free.joint(free.dof_jntid[dof]).name for dof in range(6, free.nv)]
    expected = [2e-8 if name in JOINTS else 1e-10 for name in names]
    np.testing.assert_array_equal(free.dof_armature, [0.0] * 6 + expected)


def test_stretch_pose_is_the_published_one():
    pose = dict(zip(JOINTS, np.degrees(stretch_pose()), strict=True))
    assert pose["joint_LFCoxa"] == pytest.approx(19)
    assert pose["joint_RFFemur"] == pytest.approx(-130)
    assert pose["joint_LMCoxa_roll"] == pytest.approx(90)
    assert pose["joint_RHCoxa_roll"] == pytest.approx(-150)
    assert sum(angle != 0 for angle in pose.values()) == 4 + 4 + 4


# ------------------------------------------------------------------ collision


@pytest.mark.parametrize("segment", leg_collision())
def test_shapes_reach_as_far_as_the_meshes_they_stand_for(segment):
    """A capsule along its axis, a hull along the body's axes."""
    content = (assets_folder() / "meshes" / f"{segment}.stl").read_bytes()
    records = np.frombuffer(content, np.uint8, offset=84).reshape(-1, 50)
    points = records[:, 12:48].copy().view("<f4").reshape(-1, 3)
    capsule, hull = leg_collision()[segment]["capsule"], leg_collision()[segment]["hull"]
    start, end, vertices = map(np.array, (capsule["from"], capsule["to"], hull["vertices"]))
    axis = (end - start) / np.linalg.norm(end - start)
    along = points @ axis
    assert start @ axis - capsule["radius"] == pytest.approx(along.min(), abs=0.015)
    assert end @ axis + capsule["radius"] == pytest.approx(along.max(), abs=0.015)
    np.testing.assert_allclose(vertices.min(axis=0), points.min(axis=0), atol=0.015)
    np.testing.assert_allclose(vertices.max(axis=0), points.max(axis=0), atol=0.015)


def test_hulls_have_the_imported_vertices_and_their_mirror_images(model):
    for body in LEG_BODIES:
        geom = model.geom(f"{body}_box")
        mesh = model.mesh(int(geom.dataid[0]))
        start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, geom.quat)
        found = model.mesh_vert[start : start + count] @ rotation.reshape(3, 3).T + geom.pos
        expected = np.array(leg_collision()[f"R{body[1:]}"]["hull"]["vertices"])
        expected[:, 1] *= 1 if body[0] == "R" else -1
        order = [np.lexsort(np.round(points, 5).T) for points in (found, expected)]
        # MuJoCo keeps vertices in single precision
        np.testing.assert_allclose(found[order[0]], expected[order[1]], atol=2e-7)


def test_only_legs_and_ground_can_touch():
    spec = build_fly(FlyConfig("current", symmetric=False))
    add_terrain(spec, Mixed())
    model = spec.compile()
    names = np.array([model.geom(index).name for index in range(model.ngeom)])
    ground = np.char.startswith(names, "ground_")
    capsules = np.isin(names, [f"{body}_plane" for body in LEG_BODIES])
    hulls = np.isin(names, [f"{body}_box" for body in LEG_BODIES])
    assert (capsules.sum(), hulls.sum()) == (48, 48)
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    meets = (model.geom_contype[:, None] & model.geom_conaffinity) != 0
    meets |= meets.T
    expected = (planes[:, None] & capsules) | ((ground & ~planes)[:, None] & hulls)
    np.testing.assert_array_equal(meets, expected | expected.T)


OWN = SurfaceContact(
    friction=(0.7, 0.01, 0.001), solref=(-1e5, -2e3), solimp=(0.9, 0.95, 0.002, 0.4, 1.0)
)
OWN_FIGURES = [0.7, 0.7, 0.01, 0.001, 0.001], [-1e5, -2e3], [0.9, 0.95, 0.002, 0.4, 1.0]
LITERATURE = [1, 1, 0.005, 0.0001, 0.0001], [2e-4, 1e3], [0.999, 0.9999, 0.001, 0.5, 2]


@pytest.mark.parametrize(
    ("contact", "terrain", "figures"),
    [
        (ContactConfig(plane=OWN), "flat", OWN_FIGURES),
        (ContactConfig(box=OWN), "blocks", OWN_FIGURES),
        (None, "flat", LITERATURE),
    ],
)
def test_contact_figures_are_those_of_the_leg(contact, terrain, figures):
    spec = build_fly(FlyConfig("current", symmetric=False), contact, visual=False)
    add_terrain(spec, TERRAINS[terrain])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("root").qpos[2] = 0.5
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    for found in data.contact:
        expected = np.concatenate([*figures, [3]])
        np.testing.assert_array_equal(
            [*found.friction, *found.solref, *found.solimp, found.dim], expected
        )


def test_only_the_named_segments_have_a_shape_for_planes():
    model = build_fly(contact=ContactConfig(plane_segments=("Tibia", "Tarsus5"))).compile()
    names = {model.geom(index).name for index in range(model.ngeom)}
    assert {name for name in names if name.endswith("_plane")} == {
        f"{leg}{segment}_plane" for leg in LEGS for segment in ("Tibia", "Tarsus5")
    }


# ------------------------------------------------------------------ standing


def standing_on(terrain, **body):
    """A fly that was put down in the stretch pose and has held the neutral pose for 0.1 s."""
    flies = make_batch(Joints(), terrain, physics=PHYSICS_PRESETS["reference"], **body)
    flies.set_command([[*flies.neutral_angles, *np.zeros(6)]])
    flies.step(1000)
    state = flies.state()
    assert not state.is_unstable.any()
    touching = np.flatnonzero(state.contact_forces_w[0].any(axis=1))
    return state, {CONTACT_SEGMENTS[i] for i in touching}


@pytest.mark.parametrize("terrain", ["flat", "blocks"])
def test_without_legs_the_classic_fly_lies_on_its_trunk_and_the_current_one_sinks(terrain):
    classic, current = (
        standing_on(terrain, name=name, missing_legs=LEGS)[0] for name in ("classic", "current")
    )
    ground = TERRAINS[terrain].base_height
    assert 0.4 < classic.position_w[0, 2] - ground < 1.0
    assert abs(classic.velocity_w[0, 2]) < 1.0
    # in 0.1 s it falls 49 mm
    assert current.position_w[0, 2] < -40.0


def test_the_fly_stands_on_its_six_leg_tips():
    state, touching = standing_on("flat", symmetric=False)
    assert touching == {f"{leg}Tarsus5" for leg in LEGS}
    assert state.up_b[0, 2] > 0.99
    assert state.position_w[0, 2] == pytest.approx(1.05, abs=0.03)
    assert np.linalg.norm(state.velocity_w) < 0.5


# ------------------------------------------------------------------ looks


def test_visual_meshes_touch_nothing_and_change_no_joint():
    seen = build_fly(FlyConfig("current", symmetric=False)).compile()
    bare = build_fly(FlyConfig("current", symmetric=False), visual=False).compile()
    assert (seen.ngeom, bare.ngeom) == (96 + 69, 96)
    assert (seen.nq, seen.nu, seen.nbody) == (bare.nq, bare.nu, bare.nbody)
    np.testing.assert_array_equal(seen.body_mass, bare.body_mass)
    meshes = seen.geom_group == 1
    assert not seen.geom_contype[meshes].any()
    assert not seen.geom_conaffinity[meshes].any()
    assert meshes.sum() == 69


# ------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (FlyConfig, {"adhesion_gain": -1.0}, "body.adhesion_gain must be .* to 10000, got -1.0"),
        (FlyConfig, {"missing_legs": ("LF", "LF")}, "body.missing_legs must not hold 'LF' twice"),
        (FlyConfig, {"fixed_joints": (("joint_LQTibia", 0.0),)}, "fixed_joints must be one of"),
        (FlyConfig, {"fixed_joints": (("joint_RMTibia", 9.0),)}, "angle of joint_RMTibia"),
        (SurfaceContact, {"solref": (2e-4, -1.0)}, "two positive numbers"),
        (ContactConfig, {"plane_segments": ("Tarsus6",)}, "plane_segments .*'Tarsus6'; did you"),
        (ContactConfig, {"plane_friction_across": 1, "plane_shape": "hull"}, "hull has no axis"),
    ],
)
def test_what_is_not_allowed_is_named(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(**arguments)
