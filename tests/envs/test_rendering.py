"""Pictures of environments: camera, size, and what is drawn beside the fly."""

import copy
from contextlib import closing
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import flyrl
from flyrl.simulation.marks import PLAIN
from tests.pictures import drawing

SIZE = {"width": 160, "height": 120}


def picture(env, steps=6):
    env.reset(seed=0)
    with drawing(), closing(env):
        env.render()  # where a path begins
        for _ in range(steps):
            env.step(np.float32([0.5, 0.5]))
        return env.render().astype(int)


def make(**settings):
    return gymnasium.make("flyrl/Target-v0", render_mode="rgb_array", **SIZE, **settings)


@pytest.fixture(scope="module")
def plain():
    return picture(make())


def test_the_camera_is_chosen_and_a_copy_draws_alike(plain):
    env = make(camera="top")
    top = picture(copy.deepcopy(env))
    assert np.abs(top - plain).mean() > 5
    np.testing.assert_array_equal(picture(env), top)


@pytest.mark.parametrize("name", ["leg_colours", "trace", "forces"])
def test_grip_reflexes_path_and_forces_are_drawn_if_asked(plain, name):
    overlay = replace(PLAIN, trace=True) if name == "trace" else [name]  # either will do
    changed = np.abs(picture(make(overlay=overlay)) - plain).max(axis=2) > 20
    assert 0 < changed.mean() < 0.5


def test_flies_of_a_batch_are_drawn_as_alone():
    view = {"render_mode": "rgb_array", "overlay": ["trace"], "camera": "top", **SIZE}
    envs = flyrl.make_vec("target", num_envs=2, **view)
    single = flyrl.make("target", **view)
    envs.reset(seed=5)
    single.reset(seed=6)
    with drawing():
        for _ in range(3):
            envs.step(np.zeros((2, 2), np.float32))
            single.step(np.zeros(2, np.float32))
            both, alone = envs.render(), single.render()
    np.testing.assert_array_equal(both[1], alone)
    envs.close()
    single.close()
