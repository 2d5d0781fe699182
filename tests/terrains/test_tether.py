import functools

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.terrains import Ball


@functools.cache
def walked(drive, terrain="ball", controller="cpg"):
    """Fictive velocity over the last 0.5 s of 0.8, (flies, 3), and the last state."""
    settings = {"body": "tethered", "terrain": terrain, "controller": controller}
    env = BatchedEnv(EnvConfig("hybrid_turning", decision_interval=0.02, **settings), 2, 1)
    env.reset(seeds=range(2))
    velocities = []
    for _ in range(40):
        assert (env.step(np.tile(drive, (2, 1)).astype(float)).outcome == "running").all()
        velocities.append(env.state.fictive_velocity_b)
    return np.mean(velocities[15:], axis=0), env.state


def test_the_ball_turns_back_under_a_fly_that_walks_and_is_held():
    ahead, state = walked((1, 1))
    still, _ = walked((0, 0))
    reflexes, _ = walked((1, 1), controller="hybrid")
    assert (ahead[:, 0] > 8.0).all()
    assert (np.abs(still[:, 0]) < 1.0).all()
    assert np.median(reflexes[:, 0]) > 5.0
    np.testing.assert_allclose(state.position_w[:, 2], state.position_w[0, 2], atol=5e-3)
    assert np.abs(state.yaw).max() < 0.01


@pytest.mark.parametrize(("drive", "sign"), [((1.2, 0.2), -1), ((0.2, 1.2), 1)])
def test_a_turn_is_a_turn_of_the_ball_about_the_vertical(drive, sign):
    turning, _ = walked(drive)
    assert (sign * turning[:, 2] > 2.0).all()


def test_the_velocity_of_the_top_of_the_ball_is_worked_out_by_hand():
    env = BatchedEnv(EnvConfig("hybrid_turning", body="tethered", terrain=Ball(radius=4.0)), 1, 1)
    env.reset(seeds=[0])
    dof = env.batch.scene.model.joint("ball").dofadr[0]
    # backwards over +y: the top moves along +x, at 4 mm times 2 rad/s, so the fly seems to back up
    env.flies._qvel[0, dof : dof + 3] = (0.0, 2.0, 0.5)
    np.testing.assert_allclose(env.flies.state().fictive_velocity_b, [[-8.0, 0.0, -0.5]])


def test_in_the_air_the_legs_step_and_touch_nothing():
    velocity, state = walked((1, 1), terrain="air")
    np.testing.assert_array_equal(velocity, 0.0)
    np.testing.assert_array_equal(state.contact_forces_w, 0.0)
    assert (state.phases > 12 * 2 * np.pi * 0.7).all()


def test_a_fly_that_is_not_held_drops_through_the_air():
    env = BatchedEnv(EnvConfig("hybrid_turning", terrain="air", decision_interval=0.02), 1, 1)
    env.reset(seeds=[0])
    outcomes = [env.step(np.ones((1, 2))).outcome[0] for _ in range(5)]
    assert "left_arena" in outcomes
