"""A third body is a file of the user's own: it steps, renders, is saved and evaluated like ours."""

from dataclasses import replace

import numpy as np
import pytest

from flyrl.envs.bodies import View
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.rollouts import run_episodes
from tests.pictures import drawing
from tests.simulation.puck import Puck, glide


def config(**settings) -> EnvConfig:
    return EnvConfig(glide(), body=Puck(), **settings)


def test_it_moves_as_it_is_pushed_and_is_rewarded():
    env = BatchedEnv(config(), 2)
    env.reset(seeds=[0, 1])
    np.testing.assert_allclose(env.state.position_w[:, 0], [0.0, 0.1])
    transition = env.step(np.array([[1.0, 0.0], [-1.0, 0.0]]))
    np.testing.assert_array_equal(env.state.actuation, [[5.0, 0.0], [-5.0, 0.0]])
    assert transition.reward[0] > 0.0 > transition.reward[1]


def test_a_restored_one_goes_on_with_the_same_bits():
    env, twin = BatchedEnv(config(), 3), BatchedEnv(config(), 3)
    env.reset(seeds=[3, 4, 5])
    env.step(np.random.default_rng(0).uniform(-1, 1, (3, 2)))
    twin.restore(env.snapshot())
    ours, theirs = (each.step(np.full((3, 2), 0.3)) for each in (env, twin))
    np.testing.assert_array_equal(ours.observation, theirs.observation)
    np.testing.assert_array_equal(ours.reward, theirs.reward)


def test_it_is_evaluated():
    class Ahead:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.tile([1.0, 0.0], (len(observation), 1)), None

    env = BatchedEnv(config(), 2)
    episodes = [env.config.sample_episode(seed) for seed in range(3)]
    records = run_episodes(env, Ahead(), episodes)
    assert [record.creature for record in records] == ["puck"] * 3
    assert all(record.return_ > 0.0 for record in records)


def test_it_is_drawn():
    env = BatchedEnv(config(), view=View(width=64, height=48))
    env.reset(seeds=[0])
    with drawing():
        assert env.render().shape == (48, 64, 3)
    env.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"controller": "cpg"}, "controller of a puck must be None, got 'cpg'"),
        ({"randomisation": "default"}, "randomisation of a puck must be of sensor_noise alone"),
        ({"physics": "worm"}, "physics must be one of 'balanced', got 'worm'"),
    ],
)
def test_settings_that_it_does_not_have_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        config(**settings)


def test_tasks_of_others_and_needless_fields_are_refused():
    with pytest.raises(ValueError, match="body must be a fly in the task 'target'"):
        EnvConfig("target", body=Puck())
    with pytest.raises(ValueError, match="body must be a puck in the task 'glide'"):
        EnvConfig(glide())
    env = BatchedEnv(config())
    episode = replace(env.config.sample_episode(0), joint_angles=(0.1,))
    with pytest.raises(ValueError, match=r"joint_angles of an episode of a puck must be \(\)"):
        env.reset(episodes=[episode])
