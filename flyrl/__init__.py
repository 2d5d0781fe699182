"""flyrl: reinforcement learning on top of a fly-locomotion environment."""

from flyrl.controllers import (
    CPGNetwork,
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.envs.registration import register_envs

register_envs()

__all__ = [
    "CPGNetwork",
    "PreprogrammedSteps",
    "RuleBasedSteppingCoordinator",
    "construct_rules_graph",
    "filter_edges",
]
