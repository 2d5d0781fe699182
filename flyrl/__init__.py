"""flyrl: reinforcement learning on top of a fly-locomotion environment."""

from flyrl import gl

gl.settle()  # before anything imports MuJoCo

from flyrl.controllers import (  # noqa: E402
    CPGNetwork,
    PreprogrammedSteps,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.envs.registration import register_envs  # noqa: E402
from flyrl.policies import load_policy  # noqa: E402

register_envs()

__all__ = [
    "CPGNetwork",
    "PreprogrammedSteps",
    "RuleBasedSteppingCoordinator",
    "construct_rules_graph",
    "filter_edges",
    "load_policy",
]
