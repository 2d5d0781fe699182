"""Environments by the name of their task."""

import pytest

import flyrl


def test_environments_by_task():
    assert flyrl.make("target", terrain="blocks").spec.id == "flyrl/Target-v0"
    assert flyrl.make_vec("target", num_envs=2).num_envs == 2
    assert flyrl.make_sb3("target", num_envs=2, terrain="blocks").num_envs == 2
    with pytest.raises(ValueError, match="did you mean 'target'"):
        flyrl.make("targt")
