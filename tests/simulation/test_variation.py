import dataclasses

import mujoco
import numpy as np
import pytest
from test_callback import make_batch, reset

from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.randomisation import UNVARIED, Randomisation
from flyrl.simulation.scene import SceneConfig, build_scene

FIELDS = (
    "pair_friction",
    "geom_friction",
    "body_mass",
    "body_inertia",
    "actuator_gainprm",
    "actuator_biasprm",
)


def walk(batch: FlyBatch, steps: int = 150) -> np.ndarray:
    batch.set_command(np.tile([1.2, 0.4], (batch.num_sims, 1)))
    batch.step(steps)
    return batch.integration_state()


def test_flies_that_do_not_differ_share_the_scenes_model() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.arange(2), [UNVARIED] * 2)
    assert [name for name in FIELDS if batch._batch.expanded(name) is not None] == []


@pytest.mark.parametrize(
    ("quantity", "field", "index"),
    [
        ("friction", "pair_friction", np.s_[:]),
        ("friction", "geom_friction", np.s_[:]),
        ("mass", "body_mass", np.s_[:]),
        ("mass", "body_inertia", np.s_[:]),
        ("actuator_gain", "actuator_gainprm", np.s_[:42, 0]),
        ("actuator_gain", "actuator_biasprm", np.s_[:42, 1]),
        ("adhesion", "actuator_gainprm", np.s_[42:, 0]),
    ],
)
def test_a_factor_scales_its_fields_of_its_own_simulation(
    quantity: str, field: str, index: tuple
) -> None:
    """And always from the scene's figures: half of half is still half."""
    batch = make_batch(num_sims=3)
    for _ in range(2):
        batch.vary(np.array([1]), [Randomisation(**{quantity: 0.5})])
    own = getattr(batch.scene.model, field)
    for sim in range(3):
        expected = own.copy()
        if sim == 1:
            expected[index] *= 0.5
        np.testing.assert_array_equal(getattr(batch._batch.get_model(sim), field), expected)
    assert np.any(own[index] != 0)


def halved(config: SceneConfig, quantity: str) -> SceneConfig:
    """The scene of which half the friction or adhesion is compiled in."""
    if quantity == "adhesion":
        body = dataclasses.replace(config.body, adhesion_gain=config.body.adhesion_gain / 2)
        return dataclasses.replace(config, body=body)
    contact = config.physics.contact
    surfaces = {
        name: dataclasses.replace(
            getattr(contact, name),
            friction=tuple(value / 2 for value in getattr(contact, name).friction),
        )
        for name in ("plane", "box")
    }
    physics = dataclasses.replace(config.physics, contact=dataclasses.replace(contact, **surfaces))
    return dataclasses.replace(config, physics=physics)


@pytest.mark.parametrize(
    ("quantity", "terrain"), [("friction", "flat"), ("friction", "blocks"), ("adhesion", "flat")]
)
def test_a_varied_fly_walks_as_one_that_is_compiled_so(quantity: str, terrain: str) -> None:
    batch = make_batch(terrain=terrain, num_sims=2)
    batch.vary(np.array([1]), [Randomisation(**{quantity: 0.5})])
    compiled = FlyBatch(build_scene(halved(batch.scene.config, quantity)), 2, num_threads=1)
    reset(compiled)
    plain, varied = walk(batch)
    np.testing.assert_array_equal(varied, walk(compiled)[1])
    np.testing.assert_array_equal(plain, walk(make_batch(terrain=terrain))[0])


def test_what_follows_from_masses_follows() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.array([0]), [Randomisation(mass=2.0)])
    expected = batch._batch.get_model(1)
    expected.body_mass *= 2
    expected.body_inertia *= 2
    mujoco.mj_setConst(expected, mujoco.MjData(expected))
    heavy = batch._batch.get_model(0)
    for name in ("body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0"):
        np.testing.assert_array_equal(getattr(heavy, name), getattr(expected, name))
    root = batch.thorax_body
    assert heavy.body_subtreemass[root] == 2 * batch.scene.model.body_subtreemass[root]


def test_a_fly_of_twice_the_mass_stands_with_twice_the_weight() -> None:
    batch = make_batch(num_sims=2)
    batch.vary(np.arange(2), [Randomisation(mass=mass, adhesion=0.0) for mass in (1.0, 2.0)])
    batch.step(round(0.4 / 2e-4))
    upward = np.zeros(2)
    for _ in range(100):
        batch.step(5)
        upward += batch.senses["contact_forces_w"][:, :, 2].sum(axis=1) / 100
    weight = batch.scene.model.body_mass.sum() * 9810
    np.testing.assert_allclose(upward, [weight, 2 * weight], rtol=0.02)


def test_a_servo_of_twice_the_gain_pulls_twice_as_hard() -> None:
    """At the same angle and target, kp (target - angle)."""
    batch = make_batch(num_sims=2)
    walk(batch, 50)
    batch.vary(np.array([1]), [Randomisation(actuator_gain=2.0)])
    data = batch._batch.get_data(0)
    forces = []
    for sim in (0, 1):
        model = batch._batch.get_model(sim)
        mujoco.mj_forward(model, data)
        forces.append(data.actuator_force[:42].copy())
        kp = model.actuator_gainprm[0, 0]
        offset = data.ctrl[:42] - data.qpos[batch.scene.joint_qpos]
        np.testing.assert_allclose(forces[-1], kp * offset, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(forces[1], 2 * forces[0], rtol=1e-9)


def test_a_fly_that_is_the_scenes_own_again_walks_with_its_bits() -> None:
    batch, never = make_batch(num_sims=2), make_batch(num_sims=2)
    everything = Randomisation(0.5, 2.0, 0.7, 0.4)
    batch.vary(np.array([0]), [everything])
    walk(batch, 20)
    batch.vary(np.array([0]), [UNVARIED])
    reset(batch)
    np.testing.assert_array_equal(walk(batch), walk(never))


def test_varying_one_fly_in_mid_walk_leaves_the_others_their_bits() -> None:
    batch, alone = make_batch(num_sims=3), make_batch(num_sims=3)
    for each in (batch, alone):
        walk(each, 50)
    batch.vary(np.array([1]), [Randomisation(0.5, 2.0, 0.7, 0.4)])
    varied, plain = walk(batch), walk(alone)
    np.testing.assert_array_equal(varied[[0, 2]], plain[[0, 2]])
    assert np.any(varied[1] != plain[1])
