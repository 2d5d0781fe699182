"""Learned and fixed policies behind one interface, and the safe policy bundle.

Every policy has `predict(observation, state=None, episode_start=None, deterministic=True)`, which
returns the action and the state, as in Stable-Baselines3.
"""

import importlib
from typing import TYPE_CHECKING, Any, Final

from flyrl.policies.bundle import (
    PolicyBundle,
    PolicyFileError,
    TermLayout,
    load_bundle,
    named_policies,
    observation_layout,
    save_bundle,
)
from flyrl.policies.fixed import (
    ClosedLoop,
    ConstantDrive,
    OpenLoop,
    Pursuit,
    Relaxed,
    WormCPG,
    WormReflex,
)
from flyrl.policies.laws import UnhurriedPursuit
from flyrl.policies.learned import LearnedPolicy, load_policy

if TYPE_CHECKING:
    from flyrl.policies.onnx import export_onnx
    from flyrl.policies.sb3 import export_sb3, import_sb3

# what needs torch or onnx is imported when it is first asked for
_ON_DEMAND: Final = {
    "export_onnx": "flyrl.policies.onnx",
    "export_sb3": "flyrl.policies.sb3",
    "import_sb3": "flyrl.policies.sb3",
}

__all__ = [
    "ClosedLoop",
    "ConstantDrive",
    "LearnedPolicy",
    "OpenLoop",
    "PolicyBundle",
    "PolicyFileError",
    "Pursuit",
    "Relaxed",
    "TermLayout",
    "UnhurriedPursuit",
    "WormCPG",
    "WormReflex",
    "export_onnx",
    "export_sb3",
    "import_sb3",
    "load_bundle",
    "load_policy",
    "named_policies",
    "observation_layout",
    "save_bundle",
]


def __getattr__(name: str) -> Any:
    if name not in _ON_DEMAND:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_ON_DEMAND[name]), name)
