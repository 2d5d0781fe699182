"""SBX, Stable-Baselines3's algorithms in JAX, given the id and nothing else."""

import numpy as np
import pytest

ID = "flyrl:flyrl/Target-v0"

pytestmark = pytest.mark.slow  # JAX compiles


@pytest.mark.filterwarnings("ignore")
def test_a_policy_learns_and_decides(monkeypatch):
    # its compiler is to be quick, not what it makes
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=0")
    from sbx import SAC

    model = SAC("MlpPolicy", ID, learning_starts=8, seed=0)
    before = model.policy.actor_state.params
    model.learn(12)
    after = model.policy.actor_state.params
    from jax import tree_util

    pairs = zip(*map(tree_util.tree_leaves, (before, after)), strict=True)
    assert any(not np.array_equal(one, other) for one, other in pairs)
    action, _ = model.predict(model.get_env().reset())
    assert action.shape == (1, 2)
