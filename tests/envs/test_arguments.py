"""Arguments of `make` and `make_vec` that are refused before anything is allocated."""

import gymnasium
import pytest

from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"terrain": 5}, "terrain must be a Terrain or the name of one, got 5"),
        ({"terrain": None}, "terrain must be a Terrain or the name of one, got None"),
        ({"terrain": {}}, "terrain.name must be text, got None"),
        ({"terrain": {"name": "gapped", "gap_rang": (0, 1)}}, "no 'gap_rang'; did you mean"),
        ({"terrain": "gaped"}, "terrain must be one of .* did you mean 'gapped'"),
        ({"body": 5}, "body must be a FlyConfig or WormConfig or one of 'current', .* got 5"),
        ({"physics": 5}, "physics must be a PhysicsConfig or one of .* got 5"),
        ({"randomisation": 5}, "randomisation must be a RandomisationConfig or one of .* got 5"),
        ({"controller": 5}, "controller must be a Controller or the name of one, got 5"),
        ({"task": 5}, "task must be a Task, a task function or the name of one, got 5"),
        ({"distnce": (3, 30)}, "unexpected keyword argument 'distnce'; did you mean 'distance'"),
        ({"distance": (30, 3)}, r"task\.distance must be \(least, greatest\), got \(30"),
        ({"distance": 5}, r"task\.distance must be a tuple, got 5"),
        ({"reach": 6}, r"task\.reach must be below the least task\.distance, 5\.0, got 6\.0"),
        ({"without": ["tlit"]}, r"task\.without must be one of .* did you mean 'tilt'"),
        ({"decision_interval": "2"}, "decision_interval must be a finite number .* got '2'"),
        ({"decision_interval": 1e308}, "decision_interval must lie within 0 and 10.0"),
        ({"task": "hybrid_turning", "decision_interval": 1e6}, "decision_interval must lie within"),
        ({"log_gait": "yes"}, "log_gait must be one of False, True, got 'yes'"),
        ({"terain": "flat"}, "unexpected keyword argument 'terain'; did you mean 'terrain'"),
    ],
)
def test_a_keyword_that_is_not_allowed_is_named(arguments, message):
    for make in (gymnasium.make, gymnasium.make_vec):
        with pytest.raises(ValueError, match=message):
            make("flyrl/Target-v0", **arguments)


@pytest.mark.parametrize("num_envs", [1.5, "2", True, 0, 10**9])
def test_a_number_of_environments_that_is_not_allowed_is_named(num_envs):
    with pytest.raises(ValueError, match="num_envs must be a whole number from 1 to 100000, got"):
        gymnasium.make_vec("flyrl/Target-v0", num_envs=num_envs)


def test_too_many_threads_are_refused():
    with pytest.raises(ValueError, match="num_threads must be a whole number from 0 to 1024"):
        gymnasium.make_vec("flyrl/Target-v0", num_envs=1, num_threads=100_000)


def test_a_misspelt_keyword_of_the_vector_environment_is_named():
    with pytest.raises(ValueError, match="argument 'num_thread'; did you mean 'num_threads'"):
        gymnasium.make_vec("flyrl/Target-v0", num_thread=1)


@pytest.mark.parametrize("seed", ["abc", 1.5, True, -1, 2**32])
def test_a_seed_that_is_not_allowed_is_named(seed):
    for env in (
        gymnasium.make("flyrl/Target-v0").unwrapped,
        gymnasium.make_vec("flyrl/Target-v0", num_envs=3, num_threads=1),
    ):
        with pytest.raises(ValueError, match="seed must be an integer from 0"):
            env.reset(seed=seed)


def test_a_seed_of_the_environment_of_sb3_is_named():
    with pytest.raises(ValueError, match="seed must be an integer from 0"):
        FlyrlVecEnv(EnvConfig(), 1, seed="abc")


def test_options_that_are_no_mapping_are_refused():
    with pytest.raises(ValueError, match="options must be a mapping or None, got 5"):
        gymnasium.make("flyrl/Target-v0").unwrapped.reset(options=5)
