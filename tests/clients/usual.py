"""What clients are given: the id, and settings of a short episode."""

import gymnasium

ID = "flyrl:flyrl/Target-v0"
SETTINGS = {"decision_interval": 0.1, "physics": "fast"}
LIMIT = 30  # decisions of an episode at most


def make(**settings):
    return gymnasium.make(ID, **SETTINGS, **settings)


def make_vec(mode=None, num_envs=3, **settings):
    return gymnasium.make_vec(
        ID, num_envs=num_envs, vectorization_mode=mode, **SETTINGS, **settings
    )
