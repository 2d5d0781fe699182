"""flyrl: reinforcement learning on top of a fly-locomotion environment.

Importing it registers the environments with Gymnasium, and loads neither MuJoCo nor Numba, so that
the command `flyrl` answers at once.
"""

import importlib
import importlib.util
import os
from typing import TYPE_CHECKING, Any, Final

from flyrl import gl

if TYPE_CHECKING:
    from flyrl.controllers import CPGNetwork as CPGNetwork
    from flyrl.controllers import PreprogrammedSteps as PreprogrammedSteps
    from flyrl.controllers import RuleBasedSteppingCoordinator as RuleBasedSteppingCoordinator
    from flyrl.controllers import construct_rules_graph as construct_rules_graph
    from flyrl.controllers import filter_edges as filter_edges
    from flyrl.front.environments import make as make
    from flyrl.front.environments import make_sb3 as make_sb3
    from flyrl.front.environments import make_vec as make_vec
    from flyrl.front.results import evaluate as evaluate
    from flyrl.front.runs import train as train
    from flyrl.front.walks import walk as walk
    from flyrl.policies import load_policy as load_policy
    from flyrl.tasks import OUTCOMES as OUTCOMES

# names and where they come from, imported when they are first asked for, as modules are
_ON_DEMAND: Final = {
    "OUTCOMES": "flyrl.tasks",
    "CPGNetwork": "flyrl.controllers",
    "PreprogrammedSteps": "flyrl.controllers",
    "RuleBasedSteppingCoordinator": "flyrl.controllers",
    "construct_rules_graph": "flyrl.controllers",
    "filter_edges": "flyrl.controllers",
    "evaluate": "flyrl.front.results",
    "load_policy": "flyrl.policies",
    "make": "flyrl.front.environments",
    "make_sb3": "flyrl.front.environments",
    "make_vec": "flyrl.front.environments",
    "train": "flyrl.front.runs",
    "walk": "flyrl.front.walks",
}

__all__ = list(_ON_DEMAND)


def __getattr__(name: str) -> Any:
    if name in _ON_DEMAND:
        return getattr(importlib.import_module(_ON_DEMAND[name]), name)
    if importlib.util.find_spec(f"{__name__}.{name}") is not None:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


gl.settle()  # before anything imports MuJoCo

# A shell that waits for completions makes no environment, and Gymnasium takes most of its wait.
if "_ARGCOMPLETE" not in os.environ:
    from flyrl.front.environments import register_envs

    register_envs()
