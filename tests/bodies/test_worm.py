"""The worm: its chain, its muscles, and how these bend it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from flyrl.bodies.worm import CRAWLING_ROOT, DEMONSTRATION, WormConfig, build_worm
from flyrl.muscles import load_creature, movement
from flyrl.terrains import Flat, add_terrain


def step(creature, seconds):
    for _ in range(round(seconds / creature.model.opt.timestep)):
        mujoco.mj_step(creature.model, creature.data)
    mujoco.mj_kinematics(creature.model, creature.data)


def on_the_ground(config):
    spec = build_worm(config)
    add_terrain(spec, Flat())
    return load_creature(spec)


# ------------------------------------------------------------------ the model


def test_a_chain_of_segments_and_joints():
    config = WormConfig(
        segments=4, hinge_axes=("y", "z"), joint_stiffness=7, joint_damping=2, joint_range=0.5
    )
    model = load_creature(build_worm(config)).model
    assert [model.body(i).name for i in range(5)] == [
        "world",
        *(f"Segment{i}" for i in (1, 2, 3, 4)),
    ]
    assert [model.joint(i).name for i in range(3)] == ["joint_1", "joint_2", "joint_3"]
    assert model.jnt_bodyid.tolist() == [2, 3, 4]
    assert model.jnt_axis.tolist() == [[0, 1, 0], [0, 0, 1], [0, 1, 0]]
    assert model.jnt_stiffness.ravel()[:3].tolist() == [7, 7, 7]
    assert model.dof_damping.ravel()[:3].tolist() == [2, 2, 2]
    assert model.jnt_limited.all()
    assert model.jnt_range.tolist() == [[-0.5, 0.5]] * 3


def test_a_segment_weighs_what_a_capsule_does():
    """Cylinder of length 2 and radius 0.5, and a ball: 0.5 pi + pi / 6 mm³, of 3 g/mm³."""
    config = WormConfig(segments=3, radius=0.5, segment_length=2.0, density=3.0)
    mass = build_worm(config).compile().body("Segment2").mass
    np.testing.assert_allclose(mass, 3 * (0.5 * math.pi + math.pi / 6), rtol=1e-12)


def test_a_crawling_worm_can_neither_pitch_nor_roll_and_touches_with_feet_without_weight():
    config = WormConfig(segments=3, mount="crawling", radius=0.5)
    model = build_worm(config).compile()
    hanging = build_worm(replace(config, mount="hanging")).compile()
    joints = [model.joint(i).name for i in range(model.njnt)]
    assert joints == [*CRAWLING_ROOT, "joint_1", "joint_2"]
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    assert model.jnt_type[:4].tolist() == [slide, slide, slide, hinge]
    assert model.jnt_axis[:4].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]
    np.testing.assert_array_equal(model.body_mass, hanging.body_mass)
    np.testing.assert_array_equal(model.body_inertia, hanging.body_inertia)
    assert not hanging.geom_conaffinity.any()
    touching = [model.geom(i).name for i in np.flatnonzero(model.geom_conaffinity)]
    assert touching == ["Foot1", "Foot2", "Foot3"]


# ------------------------------------------------------------------ muscles


@pytest.mark.parametrize("radius", [0.2, 5.0])
def test_a_pair_of_muscles_per_joint_acts_on_the_segment_behind_it(radius):
    config = WormConfig(segments=4, hinge_axes=("y", "z"), radius=radius)
    muscles = load_creature(build_worm(config)).muscles
    assert [(attached.name, attached.body) for attached in muscles] == [
        ("Muscle1_dorsal", "Segment2"),
        ("Muscle1_ventral", "Segment2"),
        ("Muscle2_left", "Segment3"),
        ("Muscle2_right", "Segment3"),
        ("Muscle3_dorsal", "Segment4"),
        ("Muscle3_ventral", "Segment4"),
    ]
    assert {attached.muscle.strength for attached in muscles} == {config.strength}


@pytest.mark.parametrize("axis", ["y", "z"])
@pytest.mark.parametrize("side", [0, 1])
def test_a_muscle_bends_the_worm_towards_its_side(axis, side):
    creature = load_creature(build_worm(WormConfig(segments=3, hinge_axes=(axis,))))
    data = creature.data
    mujoco.mj_kinematics(creature.model, data)
    start_w = data.geom("Segment3").xpos.copy()
    towards_w = data.site(creature.muscles[2 + side].name).xpos - start_w
    movement(creature)(300 * np.eye(4, dtype=int)[2 + side])
    step(creature, 0.3)
    # the direction has the length 1.2 mm
    assert (data.geom("Segment3").xpos - start_w) @ towards_w > 0.5


@pytest.mark.parametrize(("anchored", "bends"), [(False, [1, 1, 0]), (True, [0, 1, 0])])
def test_an_anchored_muscle_turns_its_own_joint_only(anchored, bends):
    creature = load_creature(build_worm(WormConfig(segments=4, anchored=anchored, strength=9)))
    movement(creature)([0, 0, 300, 0, 0, 0])
    mujoco.mj_forward(creature.model, creature.data)
    np.testing.assert_allclose(creature.data.qfrc_actuator, 9 * np.array(bends), atol=1e-9)


# ------------------------------------------------------------------ stability


@pytest.mark.parametrize(
    "config",
    [
        WormConfig(),
        WormConfig(anchored=False),
        WormConfig(mount="crawling", hinge_axes=("z",)),
    ],
)
def test_muscles_that_pull_at_random_do_not_explode_it(config):
    hangs = config.mount == "hanging"
    creature = load_creature(build_worm(config)) if hangs else on_the_ground(config)
    move = movement(creature)
    rng = np.random.default_rng(0)
    for _ in range(80):
        move(300 * rng.integers(0, 2, len(creature.muscles)))
        step(creature, 0.025)
        assert np.abs(creature.data.qvel).max() < 1000
        assert np.abs(creature.data.qpos[-9:]).max() < 1.3 * config.joint_range
    assert not creature.data.warning.number.any()


def test_a_worm_without_axes_is_refused():
    with pytest.raises(ValueError, match="hinge_axes must name at least one axis"):
        WormConfig(hinge_axes=())


def test_the_demonstration_floats_upright_and_its_uppermost_segment_is_moved():
    """Held at its lowest segment, without gravity: at rest it stays straight."""
    creature = load_creature(build_worm(DEMONSTRATION))
    model, data = creature.model, creature.data
    assert not model.opt.gravity.any()
    assert model.body("Segment1").jntnum[0] == 0
    assert [muscle.body for muscle in creature.muscles] == ["Segment10"]
    mujoco.mj_step(model, data, 200)
    heights = [data.geom(f"Segment{i}").xpos[2] for i in range(1, 11)]
    np.testing.assert_allclose(heights, 1.5 + 3.0 * np.arange(10), atol=1e-9)
