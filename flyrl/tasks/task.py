"""A task is a table: what is observed, what is rewarded, what ends an episode."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.simulation.state import FlyState
from flyrl.tasks.episode import Episode
from flyrl.terrains import Bounds, TerrainConfig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DRIVE_LOW: Final = -0.5
DRIVE_HIGH: Final = 1.5
"""Range of the descending drive on each side."""

RUNNING: Final = "running"
SUCCESS: Final = "success"
TIMEOUT: Final = "timeout"
UNSTABLE: Final = "unstable"


@dataclass(frozen=True)
class TaskState:
    """What terms are computed from; the first axis of every array is the simulation.

    Attributes
    ----------
    fly, previous
        The flies after this decision and before it.
    goal
        Where the episodes lead to, mm, (n, 2); (n, 0) in a task that leads nowhere.
    command
        What else the episodes ask for, (n, size of the task's command).
    totals
        What each reward term has added up to in this episode, unweighted, (n,) by name.
    remaining_s
        Time left before the time limit, s, (n,); infinite without one.
    bounds
        The terrain's extent.
    """

    fly: FlyState
    previous: FlyState
    goal: Array
    command: Array
    totals: Mapping[str, Array]
    remaining_s: Array
    bounds: Bounds


@dataclass(frozen=True)
class ObservationTerm:
    """A named part of the observation, clipped to finite bounds."""

    name: str
    shape: tuple[int, ...]
    low: float
    high: float
    compute: Callable[[TaskState], Array]
    description: str

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape))


@dataclass(frozen=True)
class RewardTerm:
    """A named part of the reward; it counts `weight` times, once per decision."""

    name: str
    weight: float
    compute: Callable[[TaskState], Array]
    description: str


@dataclass(frozen=True)
class Termination:
    """A named end of an episode; the first of a task's that holds gives the outcome."""

    outcome: str
    holds: Callable[[TaskState], Mask]
    is_success: bool = False


@dataclass(frozen=True)
class Task:
    """A decision problem on top of the descending drive.

    Attributes
    ----------
    name
        Key in `TASKS`.
    observation
        Terms in the order of the observation vector.
    is_flat
        Whether an observation is one vector (else a dict of arrays by term name).
    reward, terminations
        Tables; a simulation that blew up ends as "unstable" before any of them is asked.
    time_limit_s
        s until an episode is truncated, or None.
    decision_interval_s
        s for which a decision is held; None means one physics step.
    action_low, action_high
        Range of each of the two components of an action, mapped linearly to the drive range.
    sample_episode
        Draws an episode from a seed.
    succeeds_in_time
        Whether an episode that lasts until the time limit is a success then; without it, none is.
    """

    name: str
    observation: tuple[ObservationTerm, ...]
    is_flat: bool
    reward: tuple[RewardTerm, ...]
    terminations: tuple[Termination, ...]
    time_limit_s: float | None
    decision_interval_s: float | None
    action_low: float
    action_high: float
    sample_episode: Callable[[TerrainConfig, int], Episode]
    succeeds_in_time: Callable[[TaskState], Mask] | None = None

    def drive(self, action: Array) -> Array:
        """Map actions to drives (left, right), clipped to the action's range, (n, 2)."""
        clipped = np.clip(action, self.action_low, self.action_high)
        share = (clipped - self.action_low) / (self.action_high - self.action_low)
        return DRIVE_LOW + share * (DRIVE_HIGH - DRIVE_LOW)

    def action(self, drive: Array) -> Array:
        """Map drives to the actions that command them; the inverse of `drive`."""
        share = (np.asarray(drive) - DRIVE_LOW) / (DRIVE_HIGH - DRIVE_LOW)
        return self.action_low + share * (self.action_high - self.action_low)

    def slices(self) -> dict[str, slice]:
        """Where each observation term lies in a flat observation."""
        ends = np.cumsum([term.size for term in self.observation])
        return {
            term.name: slice(int(end) - term.size, int(end))
            for term, end in zip(self.observation, ends, strict=True)
        }
