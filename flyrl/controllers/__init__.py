"""Leg controllers: recorded steps, oscillators, stepping rules, reflexes, turning."""

from flyrl.controllers.controller import CONTROLLERS, DRIVE, Command, Controller, Joints
from flyrl.controllers.cpg import CPGNetwork
from flyrl.controllers.cpg_controller import CPG
from flyrl.controllers.hybrid import Hybrid, Reflexes
from flyrl.controllers.rule_based import (
    RuleBased,
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)
from flyrl.controllers.steered_rules import SteeredRules
from flyrl.controllers.steps import PreprogrammedSteps

CONTROLLERS.update(
    cpg=CPG, hybrid=Hybrid, rule_based=RuleBased, rule_based_steered=SteeredRules, joints=Joints
)

__all__ = [
    "CONTROLLERS",
    "CPG",
    "DRIVE",
    "CPGNetwork",
    "Command",
    "Controller",
    "Hybrid",
    "Joints",
    "PreprogrammedSteps",
    "Reflexes",
    "RuleBased",
    "RuleBasedSteppingCoordinator",
    "SteeredRules",
    "construct_rules_graph",
    "filter_edges",
]
