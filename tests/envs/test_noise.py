import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.randomisation import RandomisationConfig

NOISY = RandomisationConfig(sensor_noise=0.2)
SPREADS = {"velocity": 0.4, "heading_rate": 0.5, "tilt": 0.05}


def pair(task: str = "target", num_envs: int = 2) -> tuple[BatchedEnv, BatchedEnv]:
    """An environment with sensor noise, and the same one without."""
    noisy, exact = (
        BatchedEnv(EnvConfig(task, physics="fast", decision_interval=0.02, **more), num_envs)
        for more in ({"randomisation": NOISY}, {})
    )
    for env in (noisy, exact):
        env.reset(seeds=list(range(num_envs)))
    return noisy, exact


def test_only_what_the_fly_measures_is_noisy_by_a_share_of_its_spread() -> None:
    noisy, exact = pair(num_envs=4)
    still = noisy.task.actions.of(np.zeros((4, 2)))
    differences = []
    for _ in range(100):
        ours, theirs = noisy.step(still), exact.step(still)
        differences.append(ours.observation - theirs.observation)
        np.testing.assert_array_equal(ours.reward, theirs.reward)
        np.testing.assert_array_equal(ours.outcome, theirs.outcome)
    for name, where in noisy.task.slices().items():
        noise = np.array(differences)[..., where]
        expected = 0.2 * SPREADS.get(name, 0.0)
        assert noise.std() == pytest.approx(expected, rel=0.1), name
        assert np.abs(noise.mean()) <= 0.3 * expected, name


def test_every_row_of_a_term_has_its_own_spread() -> None:
    noisy, exact = pair("hybrid_turning", num_envs=1)
    noisy.step(np.ones((1, 2)))
    exact.step(np.ones((1, 2)))
    ours, theirs = noisy.observe(), exact.observe()
    noise = (ours["joints"] - theirs["joints"])[0].std(axis=1)
    np.testing.assert_allclose(noise, 0.2 * np.array([0.13, 15.0, 2.0]), rtol=0.4)
    np.testing.assert_array_equal(ours["fly"][0, 0], theirs["fly"][0, 0])
    np.testing.assert_array_equal(ours["end_effectors"], theirs["end_effectors"])


def test_a_second_look_shows_the_same() -> None:
    noisy, _ = pair()
    first = noisy.observe()
    np.testing.assert_array_equal(noisy.observe(), first)
    moved = noisy.step(np.ones((2, 2)), ids=np.array([1])).observation
    np.testing.assert_array_equal(moved[0, 3:8], first[0, 3:8])
    assert np.any(moved[1] != first[1])


def test_noisy_values_keep_to_their_bounds() -> None:
    env = BatchedEnv(EnvConfig(randomisation=RandomisationConfig(sensor_noise=100.0)), 1)
    observation = env.reset(seeds=[0])[0]
    tilt = observation[env.task.slices()["tilt"]]
    assert np.abs(observation).max() <= 5.0
    assert np.abs(tilt).max() <= 1.0
    assert np.abs(observation[3:8]).max() == 5.0
