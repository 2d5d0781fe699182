"""The environment at the level of joints: its spaces, its batch, and what a command does."""

import itertools

import gymnasium
import numpy as np
import pytest

from flyrl import PreprogrammedSteps
from flyrl.bodies.fly import FLIES
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.terrains import LITERATURE

POSE = PreprogrammedSteps().default_pose


def test_an_action_is_42_angles_and_6_adhesions() -> None:
    space = gymnasium.make("flyrl/Joints-v0").action_space
    assert space["joints"] == gymnasium.spaces.Box(-np.pi, np.pi, (42,), np.float32)
    assert space["adhesion"] == gymnasium.spaces.MultiBinary(6)
    flat = gymnasium.make("flyrl/JointsBox-v0").action_space
    assert flat.shape == (48,)
    np.testing.assert_array_equal(flat.low[42:], 0)
    np.testing.assert_array_equal(flat.high[42:], 1)


def test_a_dict_and_a_vector_do_the_same() -> None:
    by_name = gymnasium.make("flyrl/Joints-v0", decision_interval=0.02)
    flat = gymnasium.make("flyrl/JointsBox-v0", decision_interval=0.02)
    for env in (by_name, flat):
        env.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(5):
        joints = (POSE + rng.uniform(-0.3, 0.3, 42)).astype(np.float32)
        adhesion = rng.integers(0, 2, 6).astype(np.int8)
        by_name.step({"joints": joints, "adhesion": adhesion})
        flat.step(np.concatenate([joints, adhesion]).astype(np.float32))
    one, other = by_name.unwrapped.core.state, flat.unwrapped.core.state
    np.testing.assert_array_equal(one.joint_angles, other.joint_angles)
    np.testing.assert_array_equal(one.adhesion[0], adhesion)


TERRAINS = (*LITERATURE, "hills", "slope")
# every pair of two of them; where it tips over (docs/terrains.md) is none of these
GROUNDS = [
    (body, FLY_PRESETS[(i + j) % len(FLY_PRESETS)], terrain)
    for (i, body), (j, terrain) in itertools.product(enumerate(FLIES), enumerate(TERRAINS))
]


@pytest.mark.parametrize(("body", "physics", "terrain"), GROUNDS)
def test_a_fly_that_is_told_its_pose_stands_on_every_ground(terrain, physics, body) -> None:
    config = EnvConfig(
        "joints_box", body=body, terrain=terrain, physics=physics, decision_interval=0.02
    )
    env = BatchedEnv(config, 1, 1)
    env.reset(seeds=[1])
    pose = env.flies.neutral_angles
    for _ in range(10):
        transition = env.step(np.concatenate([pose, np.ones(6)])[None])
    assert transition.outcome[0] == "running"
    assert np.abs(env.state.joint_angles[0] - pose).max() < np.deg2rad(45)
