"""The stepping rules with a drive."""

import numpy as np
import pytest

from flyrl.controllers import SteeredRules
from flyrl.controllers.controller import OUTPUT
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.tasks import hybrid_turning

DRIVES = np.array([[1.0, 1.0], [0.0, 0.0], [1.2, 0.2], [0.2, 1.2], [-0.5, -0.5]])


@pytest.fixture(scope="module")
def walked():
    """Way along the first heading, mm, and turn, rad, in 1 s under each of DRIVES."""
    config = EnvConfig(
        task=hybrid_turning.hybrid_turning(), controller="rule_based_steered",
        decision_interval=0.02,
    )  # fmt: skip
    env = BatchedEnv(config, len(DRIVES))
    episode = config.sample_episode(1)
    env.reset(episodes=[episode] * len(DRIVES))
    turned, yaw = np.zeros(len(DRIVES)), env.state.yaw
    for _ in range(50):
        env.step(DRIVES)
        turned += (env.state.yaw - yaw + np.pi) % (2 * np.pi) - np.pi
        yaw = env.state.yaw
    return env.state.position_w[:, 0] - episode.spawn_position_w[0], turned


def test_a_drive_walks_and_none_stands(walked):
    way, _ = walked
    assert way[0] > 8.0
    assert abs(way[1]) < 1.0


def test_it_turns_to_the_side_of_the_weaker_drive(walked):
    _, turned = walked
    assert turned[2] < -1.0 < 1.0 < turned[3]


def test_a_negative_drive_walks_backwards(walked):
    way, _ = walked
    assert way[4] < -1.0


def test_the_magnitude_follows_the_drive_as_that_of_the_cpg():
    controller = SteeredRules(convergence_rate=20.0)
    parameters, state = controller.parameters(5e-4), controller.initial_state()
    output = np.zeros(1, dtype=OUTPUT)[0]
    for _ in range(100):
        controller.step(parameters, state, 0.0, np.array([1.0, -0.5]), output)
    grown = 1 - (1 - 0.01) ** 100
    np.testing.assert_allclose(state["strength"], [grown, -0.5 * grown])
    np.testing.assert_allclose(state["magnitudes"], [grown] * 3 + [0.5 * grown] * 3)
