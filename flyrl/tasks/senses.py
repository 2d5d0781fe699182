"""Rows that steering tasks share: where to go, what a fly feels of itself, what steering costs.

A fly measures its velocity, yaw rate and tilt, with noise if asked for. Drive, phases, magnitudes
and reflexes are its own commands, and legs are on the ground or not.
"""

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from typing import Any, Final

from flyrl.tasks import terms
from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW
from flyrl.tasks.task import SUCCESS, Compute, Mask, ObservationTerm, RewardTerm, Task, Termination


def direction_term(compute: Compute, angle: str) -> ObservationTerm:
    """Cos and sin of the angle to turn by."""
    text = f"cos and sin of {angle}, left positive"
    return ObservationTerm("target_direction", (2,), -1.0, 1.0, compute, text, is_bearing=True)


def distance_term(compute: Compute, place: str) -> ObservationTerm:
    """Distance to a place, in 15 mm."""
    text = f"horizontal distance to {place}, in 15 mm"
    return ObservationTerm("target_distance", (1,), 0.0, 4.0, compute, text)


TIME_LEFT: Final = ObservationTerm(
    "time_left", (1,), 0.0, 1.0, terms.time_left, "time left, in 3 s; 1 where there is more"
)
"""What an episode is worth depends on it (Pardo et al. 2018, arXiv:1712.00378): a fly that is late
has to hurry, and on rough ground haste makes it fall."""

MUSCLE_TENSIONS: Final = ObservationTerm(
    "muscle_tensions", (84,), 0.0, 1.0, attrgetter("fly.muscle_tensions"),
    "share of their strength that the legs' muscles exert", spread=0.1,
)  # fmt: skip
"""Not among the senses below, since most flies have servos; add it to a task of a fly with muscles:
task.terms=[flyrl.tasks.senses:MUSCLE_TENSIONS]."""

SENSES: Final = (
    ObservationTerm(
        "velocity", (2,), -5.0, 5.0, terms.velocity_b,
        "forward and leftward velocity of the thorax, in 20 mm/s", spread=0.4,
    ),
    ObservationTerm(
        "heading_rate", (1,), -5.0, 5.0, terms.heading_rate, "yaw rate, in 10 rad/s", spread=0.5
    ),
    ObservationTerm(
        "tilt", (2,), -1.0, 1.0, terms.tilt_b,
        "x and y of the world's up direction in the thorax frame; 0 when level", spread=0.05,
    ),
    ObservationTerm(
        "drive", (2,), DRIVE_LOW, DRIVE_HIGH, attrgetter("fly.command"),
        "drive of the last decision",
    ),
    ObservationTerm(
        "phases", (12,), -1.0, 1.0, terms.phase_vectors,
        "cosines, then sines, of the six legs' CPG phases",
    ),
    ObservationTerm(
        "magnitudes", (6,), 0.0, 2.0, attrgetter("fly.magnitudes"),
        "the six legs' CPG magnitudes",
    ),
    ObservationTerm(
        "contacts", (6,), 0.0, 1.0, terms.leg_contacts, "1 for each leg on the ground"
    ),
    ObservationTerm(
        "reflexes", (12,), 0.0, 1.0, terms.reflexes,
        "correction amounts, in 80: six of retraction, six of stumbling",
    ),
)  # fmt: skip


def steering(
    observation: tuple[ObservationTerm, ...],
    reward: tuple[RewardTerm, ...],
    solved: Callable[[Any], Mask] | None = None,
    failures: tuple[Termination, ...] = terms.FAILURES,
    work: float = 0.0,
    **table: Any,
) -> Task:
    """Task for flies that are steered, with the rows that all of these share.

    Parameters
    ----------
    observation
        The task's own terms; `TIME_LEFT` follows where it can be solved before its end, and
        `SENSES`.
    reward
        The task's own terms; `terms.SMOOTHNESS` follows.
    solved
        Whether an episode ends with a success, (n,) of bool; None: none does before its end.
    failures
        Terminations that are failures.
    work
        Weight of the joints' work.
    **table
        The other fields of the `Task`.
    """
    change, effort = terms.SMOOTHNESS
    ends = () if solved is None else (Termination(SUCCESS, solved),)
    clock = () if solved is None else (TIME_LEFT,)
    return Task(
        observation=(*observation, *clock, *SENSES),
        reward=(*reward, change, replace(effort, weight=work)),
        terminations=(*ends, *failures),
        drive_time_constant_s=terms.DRIVE_TIME_CONSTANT_S,
        **table,
    )
