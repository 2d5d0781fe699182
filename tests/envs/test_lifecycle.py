"""Environments made, copied and closed by code that knows Gymnasium and SB3 alone."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError

from flyrl.envs.core import EnvConfig
from flyrl.envs.gym import FlyrlEnv, FlyrlVectorEnv
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.simulation.physics import PHYSICS_PRESETS
from flyrl.simulation.randomisation import RANDOMISATIONS

ID = "flyrl/Target-v0"
ACTION = np.zeros((1, 2), dtype=np.float32)


@pytest.mark.parametrize(
    ("settings", "limit"),
    # Target's 3 s, in decisions of 20 ms or of what is given
    [
        ({}, 150),
        ({"decision_interval": 0.1}, 30),
        ({"max_episode_steps": 7}, 7),
        ({"task": "hybrid_turning"}, None),
    ],
)
def test_the_spec_says_when_an_episode_is_truncated(settings, limit):
    for make in (gymnasium.make, gymnasium.make_vec):
        env = make(ID, physics="fast", **settings)
        assert env.spec.max_episode_steps == limit


def test_an_environment_made_from_the_spec_is_truncated_at_the_same_step():
    env = gymnasium.make(ID, physics="fast", decision_interval=0.5)
    again = gymnasium.make(env.spec)
    assert again.spec.max_episode_steps == 6
    again.reset(seed=0)
    ends = [again.step(ACTION[0]) for _ in range(6)]
    assert [end[3] for end in ends] == [False] * 5 + [True]
    assert again.unwrapped.outcomes[ends[-1][4]["outcome"]] == "timeout"


@pytest.mark.parametrize(
    "settings",
    [
        {"randomisation": RANDOMISATIONS["default"], "physics": PHYSICS_PRESETS["fast"]},
        {"body": EnvConfig(body="fly_muscles").scene.body, "decision_interval": 0.1},
        {
            "terrain": EnvConfig(terrain="mixed").scene.terrain,
            "controller": EnvConfig(controller="rule_based").scene.controller,
            "log_gait": True,
        },
        {"task": "worm_hang", "body": EnvConfig("worm_hang").scene.body},
    ],
)
def test_every_setting_survives_the_spec_as_json(settings):
    env = gymnasium.make(ID, **settings)
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.config.scene == env.unwrapped.config.scene
    for name in ("resolved_task", "resolved_randomisation", "steps_per_decision", "log_gait"):
        assert getattr(again.unwrapped.config, name) == getattr(env.unwrapped.config, name)


@pytest.fixture(scope="module", params=["one", "many", "worm"])
def env(request):
    if request.param == "many":
        return gymnasium.make_vec(ID, num_envs=2, physics="fast", max_episode_steps=5)
    if request.param == "worm":
        return gymnasium.make("flyrl/WormHang-v0")
    return gymnasium.make(ID, physics="fast")


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_is_an_environment_of_its_own_with_the_same_settings(env, copied):
    first, _ = env.reset(seed=3)
    other = copied(env)
    assert other.spec == env.spec
    with pytest.raises(RuntimeError, match="reset"):
        other.unwrapped.step(env.action_space.sample())
    np.testing.assert_array_equal(other.reset(seed=3)[0], first)
    assert other.unwrapped.core is not env.unwrapped.core


def test_a_copy_of_an_sb3_vec_env():
    env = FlyrlVecEnv(EnvConfig("velocity", physics="fast"), 2, num_threads=1, seed=3)
    other = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(other.reset(), env.reset())
    assert other.core is not env.core


@pytest.mark.parametrize("make", [FlyrlEnv, FlyrlVectorEnv, FlyrlVecEnv])
def test_a_closed_environment_does_nothing_more(make):
    env = make(render_mode="rgb_array")
    env.reset()
    env.close()
    env.close()
    action = ACTION[0] if make is FlyrlEnv else ACTION
    for call in (env.reset, lambda: env.step(action), env.render):
        with pytest.raises(ClosedEnvironmentError, match="closed; make a new one"):
            call()


def test_keywords_of_an_sb3_vec_env_are_settings():
    env = FlyrlVecEnv(EnvConfig("velocity"), terrain="gapped")
    assert (env.core.task.name, env.config.scene.terrain.name) == ("velocity", "gapped")
