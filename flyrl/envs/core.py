"""The one environment under every interface: a task on a batch of bodies, without Python loops."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from numpy.typing import NDArray

from flyrl.envs.bodies import Bodies, SensorNoise, generator
from flyrl.envs.config import EnvConfig, Observation
from flyrl.envs.rendering import USUAL_VIEW, View, make_renderer
from flyrl.simulation.batch import MOST_SIMS, Batch
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.rendering import BodyRenderer
from flyrl.simulation.scene import Scene
from flyrl.tasks import (
    ACHIEVED_GOAL,
    DESIRED_GOAL,
    RUNNING,
    SUCCESS,
    TIMEOUT,
    UNSTABLE,
    Episode,
    TaskState,
)
from flyrl.tasks.episode import LENGTHS
from flyrl.tasks.terms import failure_info
from flyrl.validation import float_array, random_seed, whole_number

__all__ = ["BatchedEnv", "EnvConfig", "Observation", "Transition"]


@dataclass(frozen=True)
class Transition:
    """What one decision led to, for every simulation of a batch.

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


class BatchedEnv:
    """A task on `num_envs` bodies; episodes end, but are reset only on request.

    Simulation i depends on its own seed and actions alone, to the bit: not on the number of
    simulations, nor on that of threads.

    Parameters
    ----------
    config
        What to simulate.
    num_envs
        Number of simulations.
    num_threads
        Native threads; 0 takes one per CPU.
    view
        How pictures look.

    Attributes
    ----------
    simulation
        What steps the bodies.
    state
        The bodies after the last decision; one that blew up is kept as it was before.
    episodes
        What each simulation was last reset to.
    difficulty
        Of the episodes that are drawn, from 0 to 1, the usual one.
    max_decisions
        Decisions until the task truncates an episode; None without a time limit.
    """

    def __init__(
        self, config: EnvConfig, num_envs: int = 1, num_threads: int = 0, view: View = USUAL_VIEW
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 1, MOST_SIMS)
        self.config = config
        self.view = view
        self._interval_s = config.decision_interval_s
        self.task = config.resolved_task
        self.num_envs = num_envs
        self.simulation = Bodies(config, num_envs, num_threads)
        self.episodes: list[Episode | None] = [None] * num_envs
        self.difficulty = 1.0
        self._bounds = config.scene.terrain.bounds
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._goal: NDArray[np.float64] | None = None
        self._command: NDArray[np.float64] | None = None
        self._totals = np.zeros((len(self.task.reward), num_envs))
        self._noise = SensorNoise(self.task.observation, num_envs)
        self._means = {term.name: np.zeros((num_envs, term.size)) for term in self.task.means}
        self._new_share = {
            term.name: -math.expm1(-config.decision_interval_s / term.time_constant_s)
            for term in self.task.means
        }
        limit = self.task.time_limit_s
        self.max_decisions = None if limit is None else round(limit / config.decision_interval_s)
        self._renderer: BodyRenderer | None = None
        self._is_closed = False
        self._decisions = np.zeros(num_envs, dtype=np.int64)
        self._outcomes = self.task.outcomes
        self._code = {outcome: code for code, outcome in enumerate(self._outcomes)}
        self.state: Any = self.batch.state()
        self._previous = self.state

    @property
    def batch(self) -> Batch:
        """The bodies' physics."""
        return self.simulation.batch

    @property
    def flies(self) -> FlyBatch:
        """The flies' physics.

        Raises
        ------
        TypeError
            If the bodies are no flies.
        """
        batch = self.batch
        if not isinstance(batch, FlyBatch):
            raise TypeError(f"the bodies of the task {self.task.name!r} are no flies")
        return batch

    @property
    def scene(self) -> Scene:
        """The compiled scene."""
        return self.batch.scene

    @property
    def drive(self) -> NDArray[np.float64]:
        """What the bodies do by command: drives (n, 2) of flies, tensions (n, M) of worms."""
        actuation: NDArray[np.float64] = self.state.actuation
        return actuation

    @property
    def gait_logs(self) -> NDArray[np.void] | None:
        """Logs of how flies walk, (n,); None where none are kept, and of worms."""
        return self.batch.gait_logs

    def reset(
        self,
        seeds: Sequence[int | None] | None = None,
        ids: Sequence[int] | NDArray[np.intp] | None = None,
        episodes: Sequence[Episode] | None = None,
    ) -> Observation:
        """Start episodes and return the observation of all simulations.

        Parameters
        ----------
        seeds
            One per reset simulation. A simulation that is given the seed s starts episode s and
            draws its later ones from a generator seeded with s; one without draws its next.
        ids
            Which simulations; None means all.
        episodes
            Exactly these episodes instead of drawn ones.

        Raises
        ------
        ValueError
            If the numbers of entries do not fit, an episode asks for what the bodies or the
            settings do not have, or, at the first reset, a term of the task does not give an array
            of its shape.
        """
        self._check_open()
        chosen = np.arange(self.num_envs) if ids is None else np.asarray(ids, dtype=np.intp)
        for name, given in (("seeds", seeds), ("episodes", episodes)):
            if given is not None and len(given) != len(chosen):
                raise ValueError(f"{name} has {len(given)} entries; {len(chosen)} are reset")
        if len(chosen) == 0:
            return self.observe()
        if episodes is None:
            drawn = seeds if seeds is not None else [None] * len(chosen)
            episodes = [
                self.draw_episode(int(i), seed) for i, seed in zip(chosen, drawn, strict=True)
            ]
        for episode in episodes:
            self._check_spawn(episode)
        self.simulation.start(chosen, episodes)
        goals = np.array([episode.goal for episode in episodes], dtype=np.float64)
        commands = np.array([episode.command for episode in episodes], dtype=np.float64)
        is_first = self._goal is None
        if self._goal is None or self._command is None:
            self._goal = np.zeros((self.num_envs, goals.shape[1]))
            self._command = np.zeros((self.num_envs, commands.shape[1]))
        self._goal[chosen] = goals
        self._command[chosen] = commands
        self._noise.start(chosen, episodes)
        self._totals[:, chosen] = 0.0
        for mean in self._means.values():
            mean[chosen] = 0.0
        self._decisions[chosen] = 0
        for i, episode in zip(chosen, episodes, strict=True):
            self.episodes[i] = episode
        self.state = self._previous = self.batch.state()
        if is_first:
            self._check_terms(self.task_state())
        return self.observe()

    def set_goals(
        self, goals: NDArray[np.floating], ids: Sequence[int] | NDArray[np.intp] | None = None
    ) -> Observation:
        """Put goals elsewhere during episodes; return the observation of all simulations.

        Parameters
        ----------
        goals
            mm, (k, 2): one per simulation.
        ids
            Which simulations; None means all.

        Raises
        ------
        ValueError
            If the goals have the wrong shape, or are not finite.
        """
        if self._goal is None:
            raise RuntimeError("set_goals() was called before reset()")
        chosen = np.arange(self.num_envs) if ids is None else np.asarray(ids, dtype=np.intp)
        shape = (len(chosen), self._goal.shape[1])
        self._goal[chosen] = float_array(
            "goals", goals, shape, minimum=LENGTHS.low, maximum=LENGTHS.high
        )
        self.simulation.set_goals(chosen, self._goal[chosen])
        return self.observe()

    def draw_episode(self, i: int, seed: int | None = None) -> Episode:
        """Draw simulation i's episode: number `seed` if given, else its generator's next."""
        if seed is not None:
            self._rngs[i] = np.random.default_rng(random_seed(seed))
        else:
            rng = self._rngs[i]
            if rng is None:
                rng = self._rngs[i] = np.random.default_rng()
            seed = int(rng.integers(2**31))
        return self.config.sample_episode(seed, self.difficulty)

    def step(self, action: NDArray[np.floating], ids: NDArray[np.intp] | None = None) -> Transition:
        """Hold one action per simulation, (n, size of an action), for a decision interval.

        With `ids`, only these simulations move; of the others the result repeats what is.

        Raises
        ------
        ValueError
            If the actions have the wrong shape, are not finite, or not the whole numbers that the
            task takes.
        """
        self._check_open()
        actions = np.asarray(action, dtype=np.float64)
        shape = (self.num_envs, self.task.actions.size)
        if actions.shape != shape:
            raise ValueError(f"action has shape {actions.shape}; it must be {shape}")
        if not np.isfinite(actions).all():
            raise ValueError(f"action must be finite; got {actions[~np.isfinite(actions)][0]}")
        if self._goal is None:
            raise RuntimeError("step() was called before reset()")
        previous = self._previous = self.state
        moved: NDArray[np.intp] | slice = slice(None) if ids is None else ids
        self.command(self.simulation, actions, moved)
        self.batch.step(self.config.steps_per_decision, ids)
        self._decisions[moved] += 1
        if self._noise.is_on:
            self._noise.draw(moved)
        now = self.batch.state()
        is_unstable = now.is_unstable
        if is_unstable.any():
            # what blew up is shown as it was before the decision, which then ends its episode
            time = np.where(is_unstable, previous.time + self._interval_s, now.time)
            now = replace(_where(is_unstable, previous, now), time=time)
        self.state = now
        state = self._task_state(previous)
        for averaged in self.task.means:
            mean = self._means[averaged.name]
            values = averaged.compute(state)
            mean[moved] += self._new_share[averaged.name] * (values - mean)[moved]
        reward = np.zeros(self.num_envs)
        for term, total in zip(self.task.reward, self._totals, strict=True):
            values = term.compute(state)
            reward += term.weight * values
            total[moved] += values[moved]
        outcome = np.where(is_unstable, self._code[UNSTABLE], self._code[RUNNING])
        is_success = np.zeros(self.num_envs, dtype=bool)
        terminated = is_unstable.copy()
        for termination in self.task.terminations:
            ends = np.asarray(termination.holds(state), dtype=bool) & ~terminated
            outcome[ends] = self._code[termination.outcome]
            is_success[ends] = termination.is_success
            terminated |= ends
        truncated = np.zeros(self.num_envs, dtype=bool)
        if self.max_decisions is not None:
            truncated = ~terminated & (self._decisions >= self.max_decisions)
            outcome[truncated] = self._code[TIMEOUT]
            if self.task.succeeds_in_time is not None and truncated.any():
                is_success |= truncated & self.task.succeeds_in_time(state)
                outcome[is_success] = self._code[SUCCESS]
        return Transition(
            self._observe(state),
            reward,
            terminated,
            truncated,
            outcome,
            is_success,
            self._outcomes,
        )

    def command(
        self,
        bodies: Bodies,
        actions: NDArray[np.float64],
        ids: NDArray[np.intp] | slice = slice(None),
    ) -> None:
        """Set actions, (n, k), and the pushes that are due now: of these bodies, or a copy."""
        bodies.batch.set_command(self.task.actions.commands(actions[ids]), ids)
        if bodies.pushes.size:
            bodies.push(self.state, ids)

    def render(self, i: int = 0) -> NDArray[np.uint8]:
        """Picture of body i and its target, (height, width, 3).

        Raises
        ------
        RenderingUnavailableError
            If no GL context can be made.
        """
        self._check_open()
        if self._renderer is None:
            self._renderer = make_renderer(self.config, self.view)
        episode = self.episodes[i]
        return self._renderer.render(self.batch, i, goal=episode.goal if episode else ())

    def close(self) -> None:
        """Free the GL context; to reset, step or render from now on is an error."""
        self._is_closed = True
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedEnvironmentError("the environment was closed; make a new one")

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on: physics, controllers, episodes, generators.

        Returns
        -------
        Nested dicts and lists of arrays, numbers and text, for `restore`.
        """
        return {
            "simulation": self.simulation.snapshot(),
            "state": {item.name: getattr(self.state, item.name) for item in fields(self.state)},
            "goal": None if self._goal is None else self._goal.copy(),
            "command": None if self._command is None else self._command.copy(),
            "noise": self._noise.snapshot(),
            "totals": self._totals.copy(),
            "means": {name: mean.copy() for name, mean in self._means.items()},
            "decisions": self._decisions.copy(),
            "episodes": [episode and asdict(episode) for episode in self.episodes],
            "generators": [rng and rng.bit_generator.state for rng in self._rngs],
            "difficulty": self.difficulty,
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned, in an environment of the same settings."""
        records = snapshot["episodes"]
        self.episodes = [record and Episode.from_record(record) for record in records]
        self.simulation.restore(snapshot["simulation"], self.episodes)
        self.state = self._previous = replace(self.state, **snapshot["state"])
        self._goal, self._command = snapshot["goal"], snapshot["command"]
        if self._goal is not None:
            self.simulation.set_goals(np.arange(self.num_envs), self._goal)
        self._noise.restore(snapshot["noise"])
        self._totals[:] = snapshot["totals"]
        for name, mean in self._means.items():
            mean[:] = snapshot["means"][name]
        self._decisions[:] = snapshot["decisions"]
        self._rngs = [state and generator(state) for state in snapshot["generators"]]
        self.difficulty = snapshot["difficulty"]

    def observe(self) -> Observation:
        """Observation of all simulations as they are now."""
        return self._observe(self._task_state(self.state))

    def grounds(self) -> NDArray[np.int64]:
        """Seeds of the grounds that the simulations walk on, on random terrain; -1: none yet."""
        return np.array([-1 if each is None else each.ground_seed for each in self.episodes])

    def task_state(self) -> TaskState:
        """What the task's terms saw after the last decision, or see after a reset since."""
        return self._task_state(self._previous)

    def failure_info(self) -> dict[str, NDArray[Any]]:
        """What `info` tells besides in a task with goals, (n,) by key; nothing in any other."""
        return failure_info(self.task_state()) if self.task.has_goals else {}

    def _task_state(self, previous: Any) -> TaskState:
        goal, command = self._goal, self._command
        if goal is None or command is None:
            raise RuntimeError("the environment must be reset first")
        if self.max_decisions is None:
            decisions_left = np.full(self.num_envs, np.inf)
        else:
            decisions_left = (self.max_decisions - self._decisions).astype(np.float64)
        totals = {
            term.name: total for term, total in zip(self.task.reward, self._totals, strict=True)
        }
        return TaskState(
            body=self.state,
            previous=previous,
            props=self.batch.props(),
            goal=goal,
            command=command,
            totals=totals,
            means=self._means,
            decisions_left=decisions_left,
            decision_interval_s=self._interval_s,
            bounds=self._bounds,
        )

    def _check_spawn(self, episode: Episode) -> None:
        """Raise ValueError if an episode would start beside the ground or below it."""
        bounds, low = self._bounds, self.config.scene.terrain.base_height
        x, y, z = episode.spawn_position_w
        is_on_ground = bounds.x_min <= x <= bounds.x_max and bounds.y_min <= y <= bounds.y_max
        if not is_on_ground or (self.batch.has_legs and z < low):
            raise ValueError(
                f"spawn_position must lie on the ground, with x from {bounds.x_min:g} to "
                f"{bounds.x_max:g}, y from {bounds.y_min:g} to {bounds.y_max:g} and z of at least "
                f"{low:g} mm, got {episode.spawn_position_w}"
            )

    def _check_terms(self, state: TaskState) -> None:
        """Raise ValueError if a term does not give a row of its shape per simulation."""
        task = self.task
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
            if np.shape(values) != (self.num_envs, *shape):
                raise ValueError(
                    f"the task's term {name!r} must give an array of shape {('n', *shape)} for n "
                    f"simulations, got {np.shape(values)} for {self.num_envs}"
                )

    def _observe(self, state: TaskState) -> Observation:
        terms = {}
        is_noisy = self._noise.is_on
        for term in self.task.observation:
            values = term.compute(state)
            if is_noisy:
                values = values + self._noise.of(term.name)
            terms[term.name] = term.shown(values)
        if not self.task.has_vectors:
            return terms
        names = (ACHIEVED_GOAL, DESIRED_GOAL) if self.task.has_goals else ()
        goals = {name: terms.pop(name) for name in names}
        vector = np.concatenate(
            [values.reshape(self.num_envs, -1) for values in terms.values()], axis=1
        )
        return {**goals, "observation": vector} if goals else vector


def _where(mask: NDArray[np.bool_], chosen: Any, other: Any) -> Any:
    """Mix two snapshots, simulation by simulation; the flag `is_unstable` is the other's."""
    mixed = {
        item.name: np.where(
            mask.reshape((-1,) + (1,) * (getattr(other, item.name).ndim - 1)),
            getattr(chosen, item.name),
            getattr(other, item.name),
        )
        for item in fields(other)
        if item.name != "is_unstable"
    }
    return replace(other, **mixed)
