"""Worms on the native batch: muscles, crawling, bookkeeping and errors."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from flyrl.bodies.worm import CRAWLER, HANGER
from flyrl.controllers import Hybrid
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.simulation.worms import WormBatch
from flyrl.tasks import Episode
from flyrl.terrains import Prop

CRAWLING = build_scene(SceneConfig(CRAWLER))
HANGING = build_scene(SceneConfig(HANGER))
SCENES = pytest.mark.parametrize("scene", [CRAWLING, HANGING], ids=["crawling", "hanging"])


def make_batch(scene=CRAWLING, num_sims=1):
    """Straight worms at rest."""
    batch = WormBatch(scene, num_sims, num_threads=1)
    batch.start(np.arange(num_sims), [Episode(0, (0.0, 0.0, 0.0), 0.0, ())] * num_sims)
    return batch


def wriggle(batch, decisions=6):
    """Recruit at random, every 20 ms; each simulation and decision has draws of its own."""
    for decision in range(decisions):
        neurons = [
            np.random.default_rng((sim, decision)).integers(0, 16, len(batch.scene.muscles))
            for sim in range(batch.num_sims)
        ]
        batch.set_command(np.array(neurons))
        batch.step(20)


# ------------------------------------------------------------------ muscles


@SCENES
def test_a_command_gives_the_tensions_and_forces_of_the_class(scene):
    """Also beyond the pool of 16 neurons, on both sides."""
    neurons = np.random.default_rng(0).integers(-3, 20, (4, len(scene.muscles)))
    batch = make_batch(scene, num_sims=4)
    for ids in ([1, 3], [0, 2]):
        batch.set_command(neurons[ids], np.array(ids))
    batch.step()
    state = batch.state()
    ctrl = batch._batch.bind("ctrl")
    for i, attached in enumerate(scene.muscles):
        np.testing.assert_array_equal(state.tensions[:, i], attached.muscle.tension(neurons[:, i]))
        np.testing.assert_array_equal(ctrl[:, i], attached.muscle.force(neurons[:, i]))
    np.testing.assert_array_equal(state.neurons, neurons)


def test_a_model_has_its_own_pools_and_strengths():
    body = replace(HANGER, profile="linear.png", strength=7.0)
    batch = make_batch(build_scene(SceneConfig(body)))
    # of the neurons 0 to 300, with a force of 255 n / 300 each
    batch.set_command(np.full((1, 8), 150))
    batch.step()
    np.testing.assert_allclose(batch.state().tensions, 150 * 151 / (300 * 301), rtol=2e-3)
    np.testing.assert_array_equal(batch._batch.bind("ctrl"), 7.0 * batch.state().tensions)


# ------------------------------------------------------------------ motion


def crawled(body, strength=1.0, seconds=1.0):
    """How far a wave from head to tail, of 2 Hz, leads a worm along x, mm."""
    scene = build_scene(SceneConfig(body))
    batch = make_batch(scene)
    joints = np.arange(body.joints)
    for decision in range(round(seconds / 0.05)):
        phase = 2 * np.pi * (2 * 0.05 * decision - 0.4 * joints / body.joints)
        tensions = strength * np.stack([1 + np.sin(phase), 1 - np.sin(phase)], axis=1).ravel() / 2
        pulls = zip(scene.muscles, tensions, strict=True)
        batch.set_command([attached.muscle.recruit(float(tension)) for attached, tension in pulls])
        batch.step(50)
    assert not batch.state().is_unstable.any()
    return batch.state().position_w[0, 0]


def test_a_wave_of_tensions_crawls_where_feet_slip_more_easily_along_than_across():
    assert crawled(CRAWLER) > 8.0
    assert abs(crawled(CRAWLER, strength=0.0, seconds=0.3)) < 1e-9
    assert abs(crawled(replace(CRAWLER, friction_along=1.0))) < 1.0


def test_a_worm_at_rest_touches_with_one_point_under_each_middle():
    batch = make_batch()
    batch.step(100)
    data = mujoco.MjData(CRAWLING.model)
    batch.copy_into(0, CRAWLING.model, data)
    mujoco.mj_forward(CRAWLING.model, data)
    touched = [contact.pos[:2] for contact in data.contact]
    np.testing.assert_allclose(touched, data.geom_xpos[batch.segment_geoms, :2], atol=0.01)
    # 1 mm is its radius
    assert 0.93 < batch.state().position_w[0, 2] < 1.0
    # along the worm (head to +x) and across it
    assert {tuple(contact.friction[:2]) for contact in data.contact} == {(0.3, 1.0)}
    assert abs(data.contact[0].frame.reshape(3, 3)[1, 0]) == pytest.approx(1.0, abs=1e-6)


def test_a_hanging_worm_hangs_straight_above_the_ground_and_touches_nothing():
    assert not HANGING.model.geom_conaffinity.any()
    assert HANGING.model.npair == 0
    batch = make_batch(HANGING)
    batch.step(20)
    tail = batch._middles[0, batch.segment_geoms[-1]]
    # half a segment, the radius, and 2 mm
    np.testing.assert_allclose(tail, (0.0, 0.0, 1.5 + 1.0 + 2.0), atol=1e-9)


# ------------------------------------------------------------------ what a state says


@SCENES
def test_the_velocity_is_that_of_the_centre_of_mass(scene):
    batch = make_batch(scene, num_sims=2)
    wriggle(batch)
    state = batch.state()
    for sim in range(2):
        data = mujoco.MjData(scene.model)
        batch.copy_into(sim, scene.model, data)
        mujoco.mj_fwdPosition(scene.model, data)
        mujoco.mj_fwdVelocity(scene.model, data)
        mujoco.mj_subtreeVel(scene.model, data)
        head = scene.model.body("Segment1").id
        np.testing.assert_allclose(state.position_w[sim], data.subtree_com[head], atol=1e-9)
        np.testing.assert_allclose(state.velocity_w[sim], data.subtree_linvel[head], atol=1e-9)
        assert np.linalg.norm(state.velocity_w[sim]) > 0.1


def test_an_episode_places_turns_and_bends_a_worm_and_leaves_the_others_alone():
    batch = make_batch(num_sims=3)
    wriggle(batch)
    before = batch.integration_state()
    angles = (0.3, -0.2, 0.1, 0.5, 0.0)
    batch.start(np.array([1]), [Episode(0, (4.0, -7.0, 0.0), 2.5, (), joint_angles=angles)])
    np.testing.assert_array_equal(batch.integration_state()[[0, 2]], before[[0, 2]])
    state = batch.state()
    np.testing.assert_allclose(state.position_w[1], (4.0, -7.0, 1.0), atol=1e-12)
    assert state.yaw[1] == pytest.approx(2.5)
    np.testing.assert_array_equal(state.joint_angles[1], angles)
    assert state.bend[1] == pytest.approx(0.7)
    at_zero = (state.time, state.velocity_w, state.neurons, state.tensions)
    assert not any(value[1].any() for value in at_zero)


@SCENES
def test_a_picture_has_the_same_pose(scene):
    batch = make_batch(scene)
    wriggle(batch)
    drawn = build_scene(scene.config, visual=True)
    data = mujoco.MjData(drawn.model)
    batch.copy_into(0, drawn.model, data)
    places = data.geom_xpos[batch.segment_geoms]
    np.testing.assert_array_equal(places, batch._middles[0, batch.segment_geoms])


# ------------------------------------------------------------------ errors


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"controller": Hybrid()}, "controller of a worm must be None, got Hybrid"),
        ({"props": (Prop("post", "sphere", (1.0,)),)}, "props of a worm must be"),
    ],
)
def test_scenes_that_worms_do_not_have(settings, message):
    with pytest.raises(ValueError, match=message):
        SceneConfig(**{"body": CRAWLER, **settings})
