"""skrl's wrapper around `gymnasium.make_vec`."""

import gymnasium
import numpy as np
import torch
from skrl.envs.wrappers.torch import wrap_env


def make():
    return gymnasium.make_vec(
        "flyrl:flyrl/Target-v0", num_envs=2, decision_interval=0.1, physics="fast"
    )


def test_a_wrapped_batch_walks_as_the_batch_itself():
    plain, wrapped = make(), wrap_env(make())
    first, _ = wrapped.reset()  # with a seed of its own
    core = wrapped.unwrapped.core
    np.testing.assert_array_equal(first.numpy(), plain.core.reset(episodes=core.episodes))
    ours, theirs = wrapped.step(torch.ones(2, 2)), plain.step(np.ones((2, 2), np.float32))
    np.testing.assert_array_equal(ours[0].numpy(), theirs[0])
    np.testing.assert_allclose(ours[1].numpy()[:, 0], theirs[1], rtol=1e-6)
