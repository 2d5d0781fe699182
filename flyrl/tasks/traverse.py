"""Traverse: cross the ground along +x, to x = 22 mm, within 3 s."""

from typing import Final

from flyrl.tasks import terms
from flyrl.tasks.actions import Drives
from flyrl.tasks.failures import FAILURES, lost_time
from flyrl.tasks.hybrid_turning import sample_episode
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import SUCCESS, ErrorTerm, ObservationTerm, RewardTerm, Task, Termination

TRAVERSE: Final = Task(
    name="traverse",
    observation=(
        ObservationTerm(
            "target_direction", (2,), -1.0, 1.0, terms.forward_direction_b,
            "cos and sin of the bearing of the world's x axis, left positive",
            is_bearing=True,
        ),
        ObservationTerm(
            "finish_distance", (1,), -4.0, 4.0, terms.finish_distance,
            "distance to the finish line along +x, in 15 mm",
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("progress", 0.2, terms.forward_progress, "mm along +x"),
        RewardTerm("success", 2.0, terms.crossed, "the ground is crossed"),
        RewardTerm("time", -0.5, terms.elapsed, "s gone by"),
        # no failure may save the time that it cuts off
        lost_time(-0.5),
    ),
    terminations=(
        Termination(SUCCESS, terms.has_crossed),
        *FAILURES,
    ),
    time_limit_s=3.0,
    decision_interval_s=0.02,
    actions=Drives(),
    sample_episode=sample_episode,
    success=f"thorax beyond x = {terms.FINISH_LINE:g} mm",
    errors=(ErrorTerm("heading_error_deg", 180.0, terms.turn_to_finish),),
)  # fmt: skip
