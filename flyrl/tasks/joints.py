"""Joints: the published base environment, whose action is every joint's target and every grip.

Source: Wang-Chen et al. 2024, doi 10.1038/s41592-024-02497-y.
"""

from dataclasses import replace

from flyrl.tasks.actions import JointTargets
from flyrl.tasks.function import variant_of
from flyrl.tasks.hybrid_turning import hybrid_turning
from flyrl.tasks.task import Task


@variant_of(hybrid_turning)
def joints(task: Task) -> Task:
    """Observe and reward as in `hybrid_turning`; an action is a dict."""
    return replace(task, actions=JointTargets())


@variant_of(hybrid_turning)
def joints_box(task: Task) -> Task:
    """The same with one vector as its action."""
    return replace(task, actions=JointTargets(is_dict=False))
