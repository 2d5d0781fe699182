"""flyrl: reinforcement learning on top of a fly-locomotion environment."""

from flyrl.controllers import (
    CPGNetwork,
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.envs.registration import register_envs
from flyrl.policies import load_policy

register_envs()

__all__ = [
    "CPGNetwork",
    "PreprogrammedSteps",
    "RuleBasedSteppingCoordinator",
    "construct_rules_graph",
    "filter_edges",
    "load_policy",
]
