"""Leg controllers: recorded steps, oscillators, stepping rules, reflexes, turning."""

from flyrl.controllers.cpg import CPGNetwork
from flyrl.controllers.leg_controller import ControllerConfig, LegController, LegObservation
from flyrl.controllers.reflexes import Reflexes, ReflexParameters
from flyrl.controllers.steps import PreprogrammedSteps
from flyrl.controllers.walknet import (
    RuleBasedSteppingCoordinator,
    construct_rules_graph,
    filter_edges,
)

__all__ = [
    "CPGNetwork",
    "ControllerConfig",
    "LegController",
    "LegObservation",
    "PreprogrammedSteps",
    "ReflexParameters",
    "Reflexes",
    "RuleBasedSteppingCoordinator",
    "construct_rules_graph",
    "filter_edges",
]
