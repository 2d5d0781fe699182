"""A task on a batch of bodies: what it observes, rewards and ends, without Python loops."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.config import EnvConfig, Observation
from flyrl.tasks import (
    RUNNING,
    SUCCESS,
    TIMEOUT,
    UNSTABLE,
    Episode,
    ObservationTerm,
    Task,
    TaskState,
)
from flyrl.tasks.task import as_observed, side_by_side, vector_space
from flyrl.validation import FloatArray

_STREAM: Final = 171_006_538
"""Sets the generators of the noise apart from the task's, which have the same seed."""


class SensorNoise:
    """Normal noise on the observation terms that have a spread, drawn for every decision.

    Each simulation draws it from a generator of its own, seeded with its episode.

    Parameters
    ----------
    terms
        Terms of the observation.
    num_envs
        Number of simulations.

    Attributes
    ----------
    values
        The noise, the terms side by side, (n, size).
    """

    def __init__(self, terms: Sequence[ObservationTerm], num_envs: int) -> None:
        self._spread = np.concatenate([term.spreads().ravel() for term in terms])
        self._strength = np.zeros(num_envs)
        self.values = np.zeros((num_envs, self._spread.size))
        self._rngs: list[np.random.Generator | None] = [None] * num_envs

    @property
    def is_on(self) -> bool:
        """Whether there is any noise now."""
        return bool(self._strength.any())

    def start(self, ids: NDArray[np.intp], episodes: Sequence[Episode]) -> None:
        """Begin episodes: draw the noise of their first observation."""
        self._strength[ids] = [episode.randomisation.sensor_noise for episode in episodes]
        for i, episode in zip(ids, episodes, strict=True):
            is_noisy = self._strength[i] > 0.0
            self._rngs[i] = np.random.default_rng([episode.seed, _STREAM]) if is_noisy else None
        self.values[ids] = 0.0
        self.draw(ids)

    def draw(self, ids: NDArray[np.intp] | slice) -> None:
        """Draw the noise of the next observation of some simulations."""
        for i in np.arange(len(self._rngs))[ids]:
            rng = self._rngs[i]
            if rng is not None:
                drawn = rng.standard_normal(self._spread.size)
                self.values[i] = self._strength[i] * self._spread * drawn

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future noise depends on."""
        return {
            "strength": self._strength.copy(),
            "noise": self.values.copy(),
            "generators": [rng and rng.bit_generator.state for rng in self._rngs],
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned."""
        self._strength[:] = snapshot["strength"]
        self.values[:] = snapshot["noise"]
        self._rngs = [state and generator(state) for state in snapshot["generators"]]


def generator(state: Mapping[str, Any]) -> np.random.Generator:
    """Generator that resumes from the state of another."""
    rng = np.random.default_rng()
    rng.bit_generator.state = state
    return rng


@dataclass(frozen=True)
class Transition:
    """Result of one decision, for every simulation of a batch.

    Attributes
    ----------
    observation
        float32, (n, size), or a dict of (n, ...) arrays; see `Task.is_flat`.
    reward
        (n,).
    terminated, truncated
        (n,); the outcome and success below are final where one of them holds.
    outcome_code
        Index of the outcome in `outcomes`, (n,).
    is_success
        (n,).
    outcomes
        The task's outcomes by code (see `flyrl.tasks.Task.outcomes`).
    """

    observation: Observation
    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    outcome_code: NDArray[np.int64]
    is_success: NDArray[np.bool_]
    outcomes: tuple[str, ...]

    @property
    def outcome(self) -> NDArray[np.str_]:
        """Names of the outcomes, (n,): "running" until an episode ends."""
        return np.array(self.outcomes)[self.outcome_code]

    @property
    def done(self) -> NDArray[np.bool_]:
        """Whether the episode ended, (n,)."""
        return self.terminated | self.truncated


class TaskBatch:
    """A task on `num_envs` bodies: where its episodes lead to, and what came of them so far.

    Parameters
    ----------
    config
        The settings.
    num_envs
        Number of simulations.

    Attributes
    ----------
    max_decisions
        Decisions until the task truncates an episode; None without a time limit.
    goal, command
        Goals and commands of the episodes, as in `TaskState`; (num_envs, 0) before the first.
    """

    def __init__(self, config: EnvConfig, num_envs: int) -> None:
        task = self._task = config.resolved_task
        self._config = config
        limit = task.time_limit_s
        self.max_decisions = None if limit is None else round(limit / config.decision_interval_s)
        self._limit = math.inf if self.max_decisions is None else float(self.max_decisions)
        self.goal = self.command = np.zeros((num_envs, 0))
        self._decisions = np.zeros(num_envs, dtype=np.int64)
        self._totals = np.zeros((len(task.reward), num_envs))
        self._total_of = {
            term.name: total for term, total in zip(task.reward, self._totals, strict=True)
        }
        self._means = {term.name: np.zeros((num_envs, term.size)) for term in task.means}
        terms = task.observation
        self._parts = list(zip(terms, side_by_side(terms).values(), strict=True))
        self._space = vector_space(terms)
        self._noise = SensorNoise(terms, num_envs)
        self._outcomes = task.outcomes

    def start(self, ids: NDArray[np.intp], episodes: Sequence[Episode]) -> None:
        """Start episodes, one per simulation in `ids`."""
        self.goal = _with_rows(self.goal, ids, [episode.goal for episode in episodes])
        self.command = _with_rows(self.command, ids, [episode.command for episode in episodes])
        self._noise.start(ids, episodes)
        self._totals[:, ids] = 0.0
        for mean in self._means.values():
            mean[ids] = 0.0
        self._decisions[ids] = 0

    def state(self, body: Any, previous: Any, props: FloatArray) -> TaskState:
        """State that the task's terms are computed from."""
        return TaskState(
            body=body,
            previous=previous,
            props=props,
            goal=self.goal,
            command=self.command,
            totals=self._total_of,
            means=self._means,
            decisions_left=self._limit - self._decisions.astype(np.float64),
            decision_interval_s=self._config.decision_interval_s,
            bounds=self._config.scene.terrain.bounds,
        )

    def decide(
        self, body: Any, previous: Any, props: FloatArray, moved: NDArray[np.intp] | slice
    ) -> Transition:
        """Count a decision of the simulations that moved: reward it, and end what it ends."""
        self._decisions[moved] += 1
        if self._noise.is_on:
            self._noise.draw(moved)
        state = self.state(body, previous, props)
        for averaged in self._task.means:
            mean = self._means[averaged.name]
            new_share = -math.expm1(-state.decision_interval_s / averaged.time_constant_s)
            mean[moved] += new_share * (averaged.compute(state) - mean)[moved]
        reward = np.zeros(len(self._decisions))
        for term, total in zip(self._task.reward, self._totals, strict=True):
            points = state.once(term.compute)
            reward += term.weight * points
            total[moved] += points[moved]
        terminated = body.is_unstable.copy()
        code = self._outcomes.index
        outcome = np.where(terminated, code(UNSTABLE), code(RUNNING))
        is_success = np.zeros(len(reward), dtype=bool)
        for termination in self._task.terminations:
            ends = np.asarray(state.once(termination.holds), dtype=bool) & ~terminated
            outcome[ends] = code(termination.outcome)
            is_success[ends] = termination.is_success
            terminated |= ends
        truncated = ~terminated & (self._decisions >= self._limit)
        outcome[truncated] = code(TIMEOUT)
        if self._task.succeeds_in_time is not None and truncated.any():
            is_success |= truncated & self._task.succeeds_in_time(state)
            outcome[is_success] = code(SUCCESS)
        return Transition(
            self.observe(state), reward, terminated, truncated, outcome, is_success, self._outcomes
        )

    def observe(self, state: TaskState) -> Observation:
        """Observation of all simulations; see `Task.is_flat`."""
        n = len(self._decisions)
        values = np.empty((n, *self._space.shape))
        for term, part in self._parts:
            values[:, part] = np.reshape(term.compute(state), (n, -1))
        if self._noise.is_on:
            values += self._noise.values
        shown = as_observed(values, self._space.low, self._space.high)
        if self._task.is_flat:
            return shown
        named = self._parts[:2] if self._task.has_goals else self._parts
        observation = {term.name: shown[:, part].reshape(n, *term.shape) for term, part in named}
        if self._task.has_goals:
            observation["observation"] = shown[:, named[-1][1].stop :]
        return observation

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on."""
        return {
            "goal": self.goal.copy(),
            "command": self.command.copy(),
            "noise": self._noise.snapshot(),
            "totals": self._totals.copy(),
            "means": {name: mean.copy() for name, mean in self._means.items()},
            "decisions": self._decisions.copy(),
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned."""
        self.goal, self.command = snapshot["goal"], snapshot["command"]
        self._noise.restore(snapshot["noise"])
        self._totals[:] = snapshot["totals"]
        for name, mean in self._means.items():
            mean[:] = snapshot["means"][name]
        self._decisions[:] = snapshot["decisions"]


def _with_rows(values: FloatArray, ids: NDArray[np.intp], rows: Sequence[Any]) -> FloatArray:
    """Values, (n, k), with other rows at `ids`; (n, 0) become as wide as these."""
    given = np.array(rows, dtype=np.float64)
    if not values.shape[1]:
        values = np.zeros((len(values), given.shape[1]))
    values[ids] = given
    return values


def check_terms(task: Task, state: TaskState) -> None:
    """Raise ValueError if a term does not give a row of its shape per simulation."""
    num_envs = len(state.goal)
    rows: list[tuple[str, tuple[int, ...], Callable[[Any], NDArray[Any]]]] = [
        *((term.name, (term.size,), term.compute) for term in task.means),
        *((term.name, term.shape, term.compute) for term in task.observation),
        *((term.name, (), term.compute) for term in task.reward),
        *((term.name, (), term.compute) for term in task.errors),
        *((end.outcome, (), end.holds) for end in task.terminations),
    ]
    if task.succeeds_in_time is not None:
        rows.append((SUCCESS, (), task.succeeds_in_time))
    for name, shape, compute in rows:
        try:
            with np.errstate(all="ignore"):  # no time has passed yet, by which it may divide
                values = compute(state)
        except KeyError as error:
            raise ValueError(
                f"the task's term {name!r} needs the reward or mean {error}, which the task "
                "does not have (see task.without)"
            ) from error
        if np.shape(values) != (num_envs, *shape):
            raise ValueError(
                f"the task's term {name!r} must give an array of shape {('n', *shape)} for n "
                f"simulations, got {np.shape(values)} for {num_envs}"
            )
