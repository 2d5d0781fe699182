import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from flyrl.policies.networks import Normaliser
from tests.policies.conftest import Bandit


def test_by_hand():
    normaliser = Normaliser(np.array([1.0, 0.0]), np.array([3.0, 0.0]), epsilon=1.0, clip=2.5)
    observations = np.array([[5.0, 3.0], [-1.0, -2.0]])
    # (5 - 1) / 2, 3 clipped; (-1 - 1) / 2, -2
    np.testing.assert_array_equal(normaliser.apply(observations), [[2.0, 2.5], [-1.0, -2.0]])


def test_same_bits_as_in_training():
    env = VecNormalize(DummyVecEnv([lambda: Bandit(7)] * 5))
    env.seed(0)
    env.reset()
    for _ in range(10):
        env.step(np.zeros((5, 2), np.float32))
    assert isinstance(env.observation_space, gymnasium.spaces.Box)
    normaliser = Normaliser(env.obs_rms.mean, env.obs_rms.var, env.epsilon, env.clip_obs)
    observations = np.random.default_rng(0).normal(0, 20, size=(50, 7)).astype(np.float32)
    expected = env.normalize_obs(observations)
    normalised = normaliser.apply(observations.astype(np.float64))
    np.testing.assert_array_equal(normalised, expected)
    for row, values in zip(observations, normalised, strict=True):
        np.testing.assert_array_equal(normaliser.apply(row[None].astype(np.float64))[0], values)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mean": [0.0, float("nan")]}, r"normaliser\.mean must be finite"),
        ({"variance": [1.0, -1.0]}, r"normaliser\.variance must be at least 0"),
        ({"variance": [1.0]}, r"normaliser\.variance must have shape \(2,\)"),
        ({"epsilon": 0.0}, r"normaliser\.epsilon must be a finite number above 0, got 0\.0"),
        ({"clip": -1.0}, r"normaliser\.clip must be a finite number above 0, got -1\.0"),
    ],
)
def test_bad_statistics(changes, message):
    arguments = {"mean": [0.0, 0.0], "variance": [1.0, 1.0], "epsilon": 1e-8, "clip": 10.0}
    with pytest.raises(ValueError, match=message):
        Normaliser(**arguments | changes)
