"""Joints: the published base environment, whose action is every joint's target and every grip.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y.
"""

from dataclasses import replace
from typing import Final

from flyrl.tasks.actions import JointTargets
from flyrl.tasks.hybrid_turning import HYBRID_TURNING

JOINTS: Final = replace(HYBRID_TURNING, name="joints", actions=JointTargets())
"""Observed and rewarded as in `hybrid_turning`; an action is a dict."""

JOINTS_BOX: Final = replace(JOINTS, name="joints_box", actions=JointTargets(is_dict=False))
"""The same with one vector as its action."""
