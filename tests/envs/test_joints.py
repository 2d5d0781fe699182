"""The environment at the level of joints: its spaces, its batch, and what a command does."""

import itertools

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium
from stable_baselines3.common.env_checker import check_env as check_sb3

from flyrl import PreprogrammedSteps
from flyrl.bodies.fly import FLIES
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.terrains import LITERATURE
from tests.envs.test_gymnasium import warnings_of

POSE = PreprogrammedSteps().default_pose
STAND = {"joints": POSE.astype(np.float32), "adhesion": np.ones(6, np.int8)}


def test_gymnasiums_checker_has_one_remark() -> None:
    for env_id in ("flyrl/Joints-v0", "flyrl/JointsBox-v0"):
        found = warnings_of(check_gymnasium, gymnasium.make(env_id).unwrapped)
        assert all("symmetric" in message for message in found)
        assert len(found) <= 1


def test_stable_baselines_checker_remarks_on_shapes_and_the_range() -> None:
    """As it does on the literature's observation in `hybrid_turning`."""
    found = warnings_of(check_sb3, gymnasium.make("flyrl/JointsBox-v0"))
    assert sum("symmetric" in message for message in found) == 1
    assert sum("unconventional shape" in message for message in found) == len(found) - 1 == 4


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


def test_a_batch_has_the_bits_of_single_environments() -> None:
    batch = gymnasium.make_vec("flyrl/Joints-v0", num_envs=2, decision_interval=0.02)
    batch.reset(seed=5)
    actions = {name: np.stack([values, values]) for name, values in STAND.items()}
    actions["joints"][1] += 0.1
    for _ in range(4):
        batch.step(actions)
    for i in range(2):
        single = gymnasium.make("flyrl/Joints-v0", decision_interval=0.02)
        single.reset(seed=5 + i)
        for _ in range(4):
            single.step({name: values[i] for name, values in actions.items()})
        np.testing.assert_array_equal(
            single.unwrapped.core.state.position_w[0], batch.unwrapped.core.state.position_w[i]
        )


GROUNDS = [
    (body, physics, terrain)
    for body, physics, terrain in itertools.product(
        FLIES, FLY_PRESETS, (*LITERATURE, "hills", "slope")
    )
    # there it tips over, see docs/terrains.md
    if (body, physics, terrain) != ("classic", "reference", "hills")
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


def test_joint_angles_take_no_other_controller() -> None:
    with pytest.raises(ValueError, match=r"controller must be 'joints' .* got 'cpg'"):
        EnvConfig("joints", controller="cpg")
