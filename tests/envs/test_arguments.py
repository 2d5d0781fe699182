"""Settings, actions, seeds and options that are refused by name, before anything moves."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from flyrl.bodies.worm import CRAWLER, HANGER
from flyrl.controllers import Hybrid
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.tasks import TASKS

TARGET = TASKS["target"]()
SENSELESS = tuple(replace(term, spread=0.0) for term in TARGET.observation)
WORM = {"task": "worm_crawl"}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"terrain": 5}, "terrain must be a Terrain or the name of one, got 5"),
        ({"terrain": "gaped"}, "terrain must be one of .* did you mean 'gapped'"),
        ({"body": 5}, "body must be a FlyConfig or WormConfig or one of 'current', .* got 5"),
        ({"body": "worm"}, "body must be one of .*'worm_crawler'.*'worm'"),
        ({"body": "classic", "controller": Hybrid("untethered")}, "tethered"),
        ({"body": "worm_crawler"}, r"body must be a fly .* \(current, .*, tethered\), got Worm"),
        (
            {
                "task": replace(TARGET, observation=SENSELESS),
                "randomisation": RandomisationConfig(sensor_noise=0.2),
            },
            r"sensor_noise is 0\.2; it must be 0 in the task 'target'",
        ),
        ({"task": "joints", "controller": "cpg"}, "controller must be 'joints' .* got 'cpg'"),
        ({"decision_interval": 1e308}, "decision_interval must lie within 0 and 10.0"),
        ({"decision_interval": 0.0203}, "must be a positive multiple of the physics time step"),
        ({"task": replace(TARGET, time_limit_s=0.005)}, "at least one decision, 0.02 s"),
        ({"log_gait": "yes"}, "log_gait must be one of False, True, got 'yes'"),
        ({**WORM, "body": "current"}, r"body must be a worm .* \(worm_crawler, worm_hanger\), got"),
        ({**WORM, "body": "worm_hanger"}, "mount .* must be one of 'crawling', got 'hanging'"),
        (
            {"task": TASKS["worm_crawl"](), "body": replace(CRAWLER, segments=4)},
            "body must have 10 muscles in the task 'worm_crawl', got 6",
        ),
        (
            {"task": "worm_hang", "body": replace(HANGER, mount="suspended")},
            "mount of a worm in a scene must be one of 'crawling', 'hanging', got 'suspended'",
        ),
        (
            {"task": "worm_hang", "body": replace(HANGER, muscles="one")},
            "muscles of a worm in a scene must be one of 'pairs', got 'one'",
        ),
        ({**WORM, "terrain": "gapped"}, "terrain of a worm must be one of 'flat'"),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        EnvConfig(**settings)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"terain": "flat"}, "unexpected keyword argument 'terain'; did you mean 'terrain'"),
        ({"distnce": (3, 30)}, "unexpected keyword argument 'distnce'; did you mean 'distance'"),
        ({"distance": (30, 3)}, r"task\.distance must be \(least, greatest\), got \(30"),
        ({"reach": 6}, r"task\.reach must be below the least task\.distance, 5\.0, got 6\.0"),
        ({"without": ["tlit"]}, r"task\.without must be one of .* did you mean 'tilt'"),
        ({"camera": "topp"}, "camera must be one of .* did you mean 'top'"),
        ({"overlay": ["clock"]}, r"overlay\[0\] must be one of 'target', 'leg_colours', 'trace'"),
        ({"overlay": "forces"}, "overlay must be a Overlay, got 'forces'"),
        ({"width": 0}, "width must be a whole number from 1 to 4096"),
    ],
)
def test_a_keyword_that_is_not_allowed_is_named(arguments, message):
    for make in (gymnasium.make, gymnasium.make_vec):
        with pytest.raises(ValueError, match=message):
            make("flyrl/Target-v0", **arguments)
    with pytest.raises(ValueError, match=message):
        FlyrlVecEnv(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs must be a whole number from 1 to 100000, got"),
        ({"num_threads": 100_000}, "num_threads must be a whole number from 0 to 1024"),
        ({"render_mode": "human"}, "render_mode is 'human'; it must be None or 'rgb_array'"),
        ({"max_episode_steps": 0}, "max_episode_steps must be a whole number from 1"),
    ],
)
def test_a_size_that_is_not_allowed_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        gymnasium.make_vec("flyrl/Target-v0", **arguments)


@pytest.fixture(scope="module")
def envs():
    """Single environments by task."""
    settings = {"terrain": "random_blocks", "randomisation": "default"}
    return {
        "target": gymnasium.make("flyrl/Target-v0", **settings),
        "velocity": gymnasium.make("flyrl/Velocity-v0"),
        "worm_hang": gymnasium.make("flyrl/WormHang-v0"),
    }


@pytest.mark.parametrize("seed", [1.5, -1, 2**32])
def test_a_seed_that_is_not_allowed_is_named(envs, seed):
    many = gymnasium.make_vec("flyrl/Target-v0", num_envs=3, num_threads=1)
    for env in (envs["target"].unwrapped, many):
        with pytest.raises(ValueError, match="seed must be an integer from 0"):
            env.reset(seed=seed)
    with pytest.raises(ValueError, match="seed must be an integer from 0"):
        FlyrlVecEnv(EnvConfig(), 1, seed=seed)


@pytest.mark.parametrize(
    ("task", "options", "message"),
    [
        ("target", 5, "options must be a mapping or None, got 5"),
        ("target", {"init_phases": [0, 1]}, r"init_phases must have shape \(6,\), got"),
        ("target", {"init_magnitudes": [-1] * 6}, r"init_magnitudes\[0\] must be .* to 100, got"),
        ("target", {"spawn_yaw": float("nan")}, "spawn_yaw must be a finite number .*, got nan"),
        ("target", {"spawn_position": [0, 0, -1]}, "spawn_position must lie on the ground"),
        ("target", {"goal": [1e308, 0]}, r"goal\[0\] must be .*, got 1e\+308"),
        ("target", {"goall": [1, 0]}, "has no 'goall'; did you mean 'goal'"),
        ("target", {"episode": 3}, "'episode' must be an Episode; got 3"),
        ("target", {"ground": -1}, "ground must be a whole number from 0"),
        ("target", {"randomisation": {"frictoin": 1.0}}, "did you mean 'friction'"),
        ("target", {"randomisation": {"mass": 0.0}}, r"mass must be .* from 0\.01 to 100, got 0"),
        ("target", {"randomisation": 0.5}, "randomisation must be a Randomisation, got 0.5"),
        ("velocity", {"ground": 3}, r"ground of the episode is 3; .*terrain\.random is false"),
        ("worm_hang", {"init_phases": [1] * 6}, "init_phases of an episode of a worm must be"),
        ("worm_hang", {"randomisation": {"mass": 2.0}}, "of a worm must be of its senses alone"),
        ("worm_hang", {"spawn_position": [1.0, 0, 0]}, "spawn_position of a hanging worm must be"),
        ("worm_hang", {"spawn_yaw": 0.5}, "spawn_yaw of a hanging worm must be 0, got 0.5"),
    ],
)
def test_options_that_are_not_allowed_are_named(envs, task, options, message):
    with pytest.raises(ValueError, match=message):
        envs[task].unwrapped.reset(seed=0, options=options)


def test_a_fly_has_no_angles_of_a_worm():
    env = BatchedEnv(EnvConfig(physics="fast"))
    episode = replace(env.config.sample_episode(0), joint_angles=(0.1,))
    with pytest.raises(ValueError, match=r"joint_angles of an episode of a fly must be \(\), got"):
        env.reset(episodes=[episode])


@pytest.mark.parametrize(
    ("task", "action", "message"),
    [
        ("target", np.ones((2, 3)), r"action must have shape \(2, 2\), got shape \(2, 3\)"),
        ("target", np.ones(2), r"action must have shape \(2, 2\), got shape \(2,\)"),
        ("target", np.full((2, 2), np.nan), "action must be finite, got nan"),
        ("worm_crawl", np.full((2, 10), 0.5), "action must be whole numbers from 0 to"),
        ("worm_crawl_box", np.full((2, 10), np.inf), "action must be finite, got inf"),
    ],
)
def test_bad_actions_are_refused_and_move_nothing(task, action, message):
    env = BatchedEnv(EnvConfig(task), 2)
    env.reset(seeds=[0, 1])
    before = env.batch.integration_state()
    with pytest.raises(ValueError, match=message):
        env.step(action)
    np.testing.assert_array_equal(env.batch.integration_state(), before)
