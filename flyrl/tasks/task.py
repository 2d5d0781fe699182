"""A task is a table: what is observed, what is rewarded, what ends an episode."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Protocol, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from flyrl.bodies.worm import WormConfig
from flyrl.simulation.flies import FlyState
from flyrl.simulation.scene import BodyState
from flyrl.simulation.worms import WormState
from flyrl.tasks.actions import Actions, Drives
from flyrl.tasks.episode import Episode
from flyrl.terrains import Bounds, Prop, Terrain
from flyrl.validation import FloatArray, Within, check_fields

Mask = NDArray[np.bool_]
Compute = Callable[[Any], FloatArray]
"""From a `TaskState` to values (n, …)."""
OfGoals = Callable[[ArrayLike, ArrayLike, ArrayLike], FloatArray]
"""From achieved and desired goals, and the decisions that a failure cut off, to rewards."""

RUNNING: Final = "running"
SUCCESS: Final = "success"
TIMEOUT: Final = "timeout"
FALL: Final = "fall"
LEFT_ARENA: Final = "left_arena"
UNSTABLE: Final = "unstable"

OUTCOMES: Final = (RUNNING, SUCCESS, TIMEOUT, FALL, LEFT_ARENA, UNSTABLE)
"""Outcomes of flyrl's own tasks; the code of each, as in `info["outcome"]`, is its index."""

ACHIEVED_GOAL: Final = "achieved_goal"
DESIRED_GOAL: Final = "desired_goal"
"""Names of the first two observation terms of a task with goals, as in Gymnasium's GoalEnv."""

IS_FAILURE: Final = "is_failure"
DECISIONS_LOST: Final = "decisions_lost"
"""Keys of `info` in a task with goals: whether the fly failed, and how many decisions before the
time limit that cut off (0 without a failure)."""

_OF_THE_ENVIRONMENT: Final = (RUNNING, TIMEOUT, UNSTABLE)


@dataclass(frozen=True, kw_only=True)
class TaskState:
    """State that terms are computed from; the first axis is the simulation.

    Attributes
    ----------
    body, previous
        The bodies after this decision and before it: a FlyState, or in a task for worms a
        WormState. A term says `fly` or `worm`, which are the same.
    props
        Middles of the task's props, mm, (n, props, 3), ordered as `Task.props`.
    goal
        Goals of the episodes, mm, (n, 2); (n, 0) in a task without.
    command
        Commands of the episodes, (n, size of the task's command).
    totals
        Sum of each reward term in this episode, unweighted, (n,) by name.
    means
        The task's running means, (n, size) by name.
    decisions_left
        Decisions left before the time limit, (n,); infinite without one.
    decision_interval_s
        Time for which a decision is held, s.
    bounds
        The terrain's extent.
    """

    body: BodyState
    previous: BodyState
    props: FloatArray
    goal: FloatArray
    command: FloatArray
    totals: Mapping[str, FloatArray]
    means: Mapping[str, FloatArray]
    decisions_left: FloatArray
    decision_interval_s: float
    bounds: Bounds
    _known: dict[int, tuple[Any, NDArray[Any]]] = field(default_factory=dict, init=False)

    def once(self, compute: Callable[[Any], NDArray[Any]]) -> NDArray[Any]:
        """Value of a function of this state, computed when it is first asked for."""
        if id(compute) not in self._known:
            # kept beside its values, so that nothing else takes its id
            self._known[id(compute)] = compute, compute(self)
        return self._known[id(compute)][1]

    @property
    def fly(self) -> FlyState:
        """The flies after this decision."""
        return cast(FlyState, self.body)

    @property
    def worm(self) -> WormState:
        """The worms after this decision."""
        return cast(WormState, self.body)

    @property
    def remaining_s(self) -> FloatArray:
        """Time left before the time limit, s, (n,); infinite without one."""
        return self.decisions_left * self.decision_interval_s


@dataclass(frozen=True)
class ObservationTerm:
    """A named part of the observation, clipped to finite bounds.

    `compute` gives (n, *shape). `spread` says how far the values of a flat-ground walk lie apart
    (their standard deviation), as one number or one per row of the term: sensor noise is a share of
    it. What has none, 0, is known without noise: what the task asks for, and what the fly does not
    measure but command. `is_bearing` marks cosine and sine of the bearing, left positive, of what
    the task leads to.
    """

    name: str
    shape: Annotated[tuple[int, ...], Within(1, 1e6)]
    low: float
    high: float
    compute: Compute
    description: str
    spread: Annotated[float | tuple[float, ...], Within(0, 1e9)] = 0.0
    is_bearing: bool = False

    def __post_init__(self) -> None:
        check_fields(self, self.name)
        if not self.low < self.high:
            raise ValueError(f"{self.name}.high must be above its low, {self.low}, got {self.high}")
        if isinstance(self.spread, tuple) and len(self.spread) != self.shape[0]:
            raise ValueError(
                f"{self.name}.spread must be one number or {self.shape[0]}, got {self.spread}"
            )
        if self.is_bearing and self.shape != (2,):
            raise ValueError(f"{self.name}.shape must be (2,) for a bearing, got {self.shape}")

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape))

    def spreads(self) -> FloatArray:
        """`spread` of every value, of the term's shape."""
        rows = np.reshape(self.spread, (-1,) + (1,) * (len(self.shape) - 1))
        return np.array(np.broadcast_to(rows, self.shape), dtype=np.float64)


def as_observed(values: FloatArray, low: ArrayLike, high: ArrayLike) -> NDArray[np.float32]:
    """Values within their bounds, and rounded."""
    # np.clip takes twice as long for a single fly
    return np.minimum(np.maximum(values, low), high).astype(np.float32)


@dataclass(frozen=True)
class RewardTerm:
    """A named part of the reward; it counts `weight` times, once per decision.

    `compute` gives (n,); True counts as 1. In a task with goals, `of_goals` gives the same, to the
    bit, from the goals achieved and desired as they are observed, (..., size of a goal) each, and
    from the decisions that a failure cut off, (...), for any goals.
    """

    name: str
    weight: float
    compute: Callable[[Any], FloatArray | Mask]
    description: str
    of_goals: OfGoals | None = None

    def __post_init__(self) -> None:
        check_fields(self, self.name)


@dataclass(frozen=True)
class MeanTerm:
    """A named quantity that the environment averages over the recent past, for other terms to use.

    The mean starts an episode at 0 and forgets exponentially: what is `time_constant_s` ago counts
    1/e of what is now. It is brought up to date once per decision, before any other term is asked.
    `compute` gives (n, size).
    """

    name: str
    size: Annotated[int, Within(1, 1e6)]
    time_constant_s: Annotated[float, Within(1e-6, 3600)]
    compute: Compute
    description: str

    def __post_init__(self) -> None:
        check_fields(self, self.name)


@dataclass(frozen=True)
class ErrorTerm:
    """A named error of the body against what it is asked to do, for evaluations alone.

    An evaluation takes the mean over an episode's decisions, and over the time that a failure cut
    off it counts `worst`. `compute` gives (n,), none below 0. The name is that of a metric, and
    ends in its unit, as in "path_error_mm". `smallest_effect` is the smallest difference of
    interest, in that unit.
    """

    name: str
    worst: Annotated[float, Within(1e-9, 1e9)]
    compute: Compute
    description: str
    smallest_effect: Annotated[float, Within(0, 1e9)] = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ValueError(
                f"name of an error term must be a word of letters, digits and _, got {self.name!r}"
            )
        check_fields(self, self.name)


@dataclass(frozen=True)
class Termination:
    """A named end of an episode; the first of a task's that holds gives the outcome.

    The outcome `SUCCESS` is a success, every other one a failure. `holds` gives (n,) of bool.
    """

    outcome: str
    holds: Callable[[Any], Mask]

    def __post_init__(self) -> None:
        if not self.outcome or self.outcome in _OF_THE_ENVIRONMENT:
            raise ValueError(
                f"outcome must be a name other than {', '.join(_OF_THE_ENVIRONMENT)}, which the "
                f"environment gives itself, got {self.outcome!r}"
            )

    @property
    def is_success(self) -> bool:
        """Whether the task is solved by it."""
        return self.outcome == SUCCESS


Term = ObservationTerm | RewardTerm | MeanTerm | Termination | ErrorTerm


class EpisodeSampler(Protocol):
    """Draws an episode from a seed; one of difficulty 1 is what a policy is judged on."""

    def __call__(self, terrain: Terrain, seed: int, difficulty: float = 1.0) -> Episode:
        """Episode number `seed`, from the easiest (difficulty 0) to the usual (1)."""
        ...


@dataclass(frozen=True, kw_only=True)
class Task:
    """A decision problem on top of the descending drive, or of muscles.

    Attributes
    ----------
    observation
        Terms in the order of the observation vector.
    reward, terminations
        Tables; a simulation that blew up ends as "unstable" before any of them is asked.
    sample_episode
        Draws an episode from a seed.
    time_limit_s
        s until an episode is truncated, or None.
    is_flat
        Whether an observation is one vector (else a dict: in a task with goals of both goals and
        "observation", the vector of all other terms; in any other of arrays by term name).
    decision_interval_s
        s for which a decision is held; None means one physics step.
    actions
        Action space, and the commands that actions stand for.
    drive_time_constant_s
        s; the drive follows what actions ask for as a first-order low-pass with this time constant,
        from decision to decision; 0: at once.
    succeeds_in_time
        Whether an episode that lasts until the time limit is a success then; without it, none is.
    means
        Running means that the other terms are computed from.
    difficulty
        Quantities that grow with the difficulty, in words; empty where none does.
    is_reached
        Makes a task one with goals, as in Gymnasium's GoalEnv: whether achieved goals are the
        desired ones, as they are observed, (..., size of a goal) each. The first two observation
        terms are `ACHIEVED_GOAL` and `DESIRED_GOAL`, and an episode terminates where `is_reached`
        holds or the fly fails (see `flyrl.tasks.FAILURES`).
    errors
        Errors that an evaluation measures besides success and return.
    decisive
        Metrics of an evaluation that decide who is best, each among those equal in the one before.
    compared
        Metrics that an evaluation compares by, besides success, the decisive ones and the return.
    success
        Definition of a success, in words; empty where there is none.
    extent_mm
        Distance from the start, mm, that an episode may lead to; None: the usual ground will do.
    props
        Objects on the ground; `sample_episode` places them.
    name
        Name of its task function, which sets it: built in, or `module:attribute`.
    parameters
        Parameters of the task function, by name; it sets them.
    worm
        Worm that it is built for; None for a fly. The task function sets it.
    added
        Terms added to the table (see `extended`), by where they come from: `module:attribute`.
    removed
        Rows of the task function's table that were taken out, as `table.name`.
    """

    observation: tuple[ObservationTerm, ...]
    reward: tuple[RewardTerm, ...]
    terminations: tuple[Termination, ...]
    sample_episode: EpisodeSampler
    time_limit_s: float | None
    is_flat: bool = True
    decision_interval_s: float | None = 0.02
    actions: Actions = field(default_factory=Drives)
    drive_time_constant_s: float = 0.0
    succeeds_in_time: Callable[[Any], Mask] | None = None
    means: tuple[MeanTerm, ...] = ()
    difficulty: str = ""
    is_reached: Callable[[ArrayLike, ArrayLike], Mask] | None = None
    errors: tuple[ErrorTerm, ...] = ()
    decisive: tuple[str, ...] = ("success", "time_to_goal_s")
    compared: tuple[str, ...] = ("time_to_goal_s", "speed_mm_s")
    success: str = ""
    extent_mm: float | None = None
    props: tuple[Prop, ...] = ()
    name: str = "task"
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    worm: WormConfig | None = None
    added: Mapping[str, Term] = field(default_factory=dict, hash=False)
    removed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        first = tuple(term.name for term in self.observation[:2])
        if self.has_goals and (self.is_flat or first != (ACHIEVED_GOAL, DESIRED_GOAL)):
            raise ValueError(
                f"observation of a task with goals must be a dict whose first terms are "
                f"{ACHIEVED_GOAL!r} and {DESIRED_GOAL!r}, got {first}, is_flat={self.is_flat}"
            )

    @property
    def has_goals(self) -> bool:
        """Whether episodes have goals that can be swapped afterwards."""
        return self.is_reached is not None

    @property
    def has_vectors(self) -> bool:
        """Whether an observation is one vector, or goals and a vector: what policies take."""
        return self.is_flat or self.has_goals

    def flattened(self) -> "Task":
        """The same task, whose observation is one vector, for policies that take no dict.

        Terms stand in alphabetical order, each row by row, as `gymnasium.spaces.flatten` has them.
        A task with vectors stays as it is.
        """
        if self.has_vectors:
            return self
        terms = tuple(sorted(self.observation, key=lambda term: term.name))
        return replace(self, observation=terms, is_flat=True)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Outcomes by code: `OUTCOMES`, then those of terminations added to the task, in order."""
        return tuple(dict.fromkeys((*OUTCOMES, *(end.outcome for end in self.terminations))))

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """Gymnasium's space of an observation; finite bounds, to which terms are clipped."""
        if self.is_flat:
            return vector_space(self.observation)
        named = self.observation[:2] if self.has_goals else self.observation
        boxes: dict[str, spaces.Space[Any]] = {
            term.name: spaces.Box(term.low, term.high, term.shape, np.float32) for term in named
        }
        if self.has_goals:
            boxes["observation"] = vector_space(self.observation[2:])
        return spaces.Dict(boxes)

    def slices(self) -> dict[str, slice]:
        """Slice of each observation term in a flat observation; see `flattened`."""
        return side_by_side(self.flattened().observation)


def side_by_side(terms: Sequence[ObservationTerm]) -> dict[str, slice]:
    """Slices of terms in their vector, in this order."""
    ends = np.cumsum([term.size for term in terms]).tolist()
    return {term.name: slice(end - term.size, end) for term, end in zip(terms, ends, strict=True)}


def vector_space(terms: Sequence[ObservationTerm]) -> spaces.Box:
    """Gymnasium's space of the vector of terms."""
    low = np.concatenate([np.full(term.size, term.low, np.float32) for term in terms])
    high = np.concatenate([np.full(term.size, term.high, np.float32) for term in terms])
    return spaces.Box(low, high, dtype=np.float32)
