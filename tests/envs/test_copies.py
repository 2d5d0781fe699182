"""Simulations that start as copies of others."""

from dataclasses import replace

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.randomisation import RANDOMISATIONS

VARIED = replace(RANDOMISATIONS["default"], missing_leg=LEGS)
CONFIG = EnvConfig("heading", terrain="random_mixed", physics="fast", randomisation=VARIED)


def test_copies_lead_to_the_same_bits_as_what_they_copy():
    env, copies = BatchedEnv(CONFIG, 2), BatchedEnv(CONFIG, 3)
    env.reset(seeds=[5, 6])
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 2, 2))
    for action in actions[:10]:
        env.step(action)
    np.testing.assert_array_equal(copies.copy_from(env, [1, 0, 1]), env.observe()[[1, 0, 1]])
    for action in actions[10:]:
        mine, theirs = env.step(action), copies.step(action[[1, 0, 1]])
        np.testing.assert_array_equal(theirs.observation, mine.observation[[1, 0, 1]])
        np.testing.assert_array_equal(theirs.reward, mine.reward[[1, 0, 1]])


def test_one_simulation_is_named_for_each():
    env, copies = BatchedEnv(CONFIG, 2), BatchedEnv(CONFIG, 3)
    env.reset(seeds=[5, 6])
    with pytest.raises(ValueError, match="sims must be 3 simulations"):
        copies.copy_from(env, [0, 1])
