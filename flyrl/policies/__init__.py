"""Learned and fixed policies behind one interface, and the safe policy bundle.

Every policy has `predict(observation, state=None, episode_start=None, deterministic=True)`, which
returns the action and the state, as in Stable-Baselines3.
"""

from flyrl.policies.bundle import PolicyBundle, PolicyFileError, TermLayout, observation_layout
from flyrl.policies.fixed import ConstantDrive, OpenLoop, Pursuit
from flyrl.policies.learned import LearnedPolicy, load_policy

__all__ = [
    "ConstantDrive",
    "LearnedPolicy",
    "OpenLoop",
    "PolicyBundle",
    "PolicyFileError",
    "Pursuit",
    "TermLayout",
    "load_policy",
    "observation_layout",
]
