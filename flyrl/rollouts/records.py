"""What one episode of one controller left behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl import tasks
from flyrl.tasks import RUNNING, SUCCESS, TIMEOUT, UNSTABLE, Episode

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FAILURES: Final = (*(failure.outcome for failure in tasks.FAILURES), UNSTABLE)
"""Outcomes that end an episode by failing; they are scored over the full horizon."""

SAMPLING_S: Final = 0.02
"""Least spacing of a record's samples, s: a quarter of a stride."""


@dataclass(frozen=True, eq=False)
class Gait:
    """How a fly walked: what its legs did, sample by sample, and what it cost.

    Attributes
    ----------
    interval_s
        Time from one sample to the next, s.
    stance, adhesion
        Whether a leg stands (see `gait_log.STANCE_SPEED`), and whether it is commanded to grip,
        (S, 6), ordered as `anatomy.LEGS`.
    retraction, stumbling
        Whether that reflex corrects a leg, shape (S, 6).
    work_nj
        Done by the servos, nJ; what is done on them is not taken off.
    slip_mm
        Way of each leg's tip along the ground while it is on it and grips, mm, shape (6,).
    """

    interval_s: float
    stance: BoolArray
    adhesion: BoolArray
    retraction: BoolArray
    stumbling: BoolArray
    work_nj: float
    slip_mm: FloatArray


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """One episode of one controller: how it ended, and the path it took.

    The trajectory has a sample at the start, one every decision or `SAMPLING_S`, whichever is
    longer, and one at the end: T samples in all, every one finite. A fly whose physics diverged
    stays where it was before.

    Attributes
    ----------
    controller
        Name of the entrant that walked.
    task, terrain
        Names of the task and of the terrain.
    index
        Position of the episode in the list that every controller walks.
    episode
        Everything random about the episode: seed, spawn, goal, phases.
    outcome
        Name of an outcome (see `flyrl.tasks.OUTCOMES`), or of a termination added to the task.
    return_
        Undiscounted sum of rewards.
    duration_s
        Simulated time until the episode ended, s.
    horizon_s
        Time limit of the task, s.
    time_s
        Sample times since the start, s, shape (T,).
    position_w
        Position of the thorax, or of a worm's middle, mm, world frame, shape (T, 3).
    yaw
        Heading about the world's z axis, rad, unwrapped, shape (T,).
    drive
        Descending drive (left, right) held up to the sample, shape (T, 2); zero at the start. Of a
        worm, the tensions of its M muscles, shape (T, M).
    errors
        Mean over the horizon of what the task measures, by name (see `tasks.ERRORS`); the time that
        a failure cut off counts as the worst.
    totals
        Sum of each reward term, unweighted, by name.
    gait
        How the fly walked until then, where the environment logs it. Of a fly whose physics
        diverged, until the decision before.
    creature
        What walked: "fly" or "worm".
    """

    controller: str
    task: str
    terrain: str
    index: int
    episode: Episode
    outcome: str
    return_: float
    duration_s: float
    horizon_s: float
    time_s: FloatArray
    position_w: FloatArray
    yaw: FloatArray
    drive: FloatArray
    errors: Mapping[str, float] = field(default_factory=dict)
    totals: Mapping[str, float] = field(default_factory=dict)
    gait: Gait | None = None
    creature: str = "fly"

    def __post_init__(self) -> None:
        if self.outcome in ("", RUNNING):
            raise ValueError(f"outcome must be that of an episode that ended, got {self.outcome!r}")
        samples = len(self.time_s)
        shapes = {
            "time_s": (samples,),
            "position_w": (samples, 3),
            "yaw": (samples,),
            "drive": (samples, *((2,) if self.creature == "fly" else np.shape(self.drive)[-1:])),
        }
        for name, shape in shapes.items():
            values = getattr(self, name)
            if np.shape(values) != shape or samples == 0:
                raise ValueError(
                    f"{name} must have shape {shape} and a sample, got {np.shape(values)}"
                )
            if not np.isfinite(values).all():
                raise ValueError(f"{name} must be finite, got {values[~np.isfinite(values)][0]}")

    @property
    def seed(self) -> int:
        """Seed that the episode was drawn from."""
        return self.episode.seed

    @property
    def success(self) -> bool:
        """Whether the task was solved."""
        return self.outcome == SUCCESS

    @property
    def failed(self) -> bool:
        """Whether the episode was cut short by a fall or whatever else is no success."""
        return self.outcome not in (SUCCESS, TIMEOUT)
