"""Leg controllers: recorded steps, oscillators, stepping rules, reflexes, turning."""

from flyrl.controllers.controller import CONTROLLERS as CONTROLLERS
from flyrl.controllers.controller import DRIVE as DRIVE
from flyrl.controllers.controller import Command as Command
from flyrl.controllers.controller import Controller as Controller
from flyrl.controllers.controller import Joints as Joints
from flyrl.controllers.cpg import CPGNetwork as CPGNetwork
from flyrl.controllers.cpg_controller import CPG as CPG
from flyrl.controllers.hybrid import Hybrid as Hybrid
from flyrl.controllers.hybrid import Reflexes as Reflexes
from flyrl.controllers.rule_based import RuleBased as RuleBased
from flyrl.controllers.rule_based import (
    RuleBasedSteppingCoordinator as RuleBasedSteppingCoordinator,
)
from flyrl.controllers.rule_based import construct_rules_graph as construct_rules_graph
from flyrl.controllers.rule_based import filter_edges as filter_edges
from flyrl.controllers.steered_rules import SteeredRules as SteeredRules
from flyrl.controllers.steps import PreprogrammedSteps as PreprogrammedSteps

CONTROLLERS.update(
    cpg=CPG, hybrid=Hybrid, rule_based=RuleBased, rule_based_steered=SteeredRules, joints=Joints
)
