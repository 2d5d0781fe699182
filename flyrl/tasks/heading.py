"""Heading: turn to a compass heading and keep it, for 4 s, in spite of two pushes from the side.

A success is to be within 15 degrees of it for 2 of the 4 s.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from flyrl.tasks import hybrid_turning, terms
from flyrl.tasks.actions import Drives
from flyrl.tasks.episode import Episode
from flyrl.tasks.failures import FAILURES, lost_time
from flyrl.tasks.senses import SENSES
from flyrl.tasks.task import ErrorTerm, Mask, ObservationTerm, RewardTerm, Task, TaskState
from flyrl.terrains import Terrain

TIME_LIMIT_S: Final = 4.0

KEPT_S: Final = 2.0
"""s on the heading that make a success; turning round takes about one."""


PUSH_TIMES: Final = ((1.0, 2.0), (2.5, 3.5))
"""s; a push starts within each of these."""

PUSHES: Final = (4.0, 8.0)
"""µN, to either side; a fly weighs 10. They turn a walking fly by 17 to 33 degrees and shift it by
2 to 4 mm within half a second; of 24 flies that walked straight on flat ground none fell."""


def sample_episode(terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
    """Draw a spawn, a heading and pushes (all uniform), and the CPG's start.

    With the difficulty, the headings grow from straight ahead to all around, and the pushes from
    none to their full strength.
    """
    rng = np.random.default_rng([seed, 1])
    heading = difficulty * rng.uniform(-np.pi, np.pi)
    pushes: list[float] = []
    for start, end in PUSH_TIMES:
        side = rng.choice([-1.0, 1.0])
        pushes += [float(rng.uniform(start, end)), float(difficulty * side * rng.uniform(*PUSHES))]
    episode = hybrid_turning.sample_episode(terrain, seed, difficulty)
    return replace(episode, command=(float(heading),), pushes=tuple(pushes))


def was_kept(state: TaskState) -> Mask:
    """Whether the fly was on the heading for KEPT_S, (n,)."""
    # but for rounding: the total is a sum of decisions
    return state.totals["on_heading"] >= KEPT_S - 1e-6


HEADING: Final = Task(
    name="heading",
    observation=(
        ObservationTerm(
            "target_direction", (2,), -1.0, 1.0, terms.commanded_direction_b,
            "cos and sin of the commanded heading from the fly's own, left positive",
            is_bearing=True,
        ),
        *SENSES,
    ),
    is_flat=True,
    reward=(
        RewardTerm("along_heading", 1.0, terms.time_along_heading, "s times cos of the error"),
        RewardTerm("on_heading", 1.0, terms.time_on_heading, "s within 15 degrees"),
        RewardTerm("forward", 0.02, terms.forward_way, "mm walked forward"),
        # the worst that the time cut off could have brought
        lost_time(-1.0),
    ),
    terminations=FAILURES,
    time_limit_s=TIME_LIMIT_S,
    decision_interval_s=0.02,
    actions=Drives(),
    sample_episode=sample_episode,
    difficulty="turn, from 0 to ±180°, and pushes, from none to 4-8 µN",
    succeeds_in_time=was_kept,
    success=f"within {np.rad2deg(terms.ON_HEADING):.0f} degrees of the heading for {KEPT_S:g} s",
    errors=(ErrorTerm("heading_error_deg", 180.0, terms.turn_to_heading),),
)  # fmt: skip
