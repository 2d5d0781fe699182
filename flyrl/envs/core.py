"""The one environment under every interface: a task on a batch of bodies, without Python loops."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from numpy.typing import NDArray

from flyrl.envs.bodies import USUAL_VIEW, Bodies, View, make_renderer
from flyrl.envs.config import EnvConfig, Observation
from flyrl.envs.task_batch import TaskBatch, Transition, check_terms, generator
from flyrl.simulation.batch import MOST_SIMS, Batch
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.rendering import BodyRenderer
from flyrl.tasks import Episode, TaskState
from flyrl.tasks.episode import LENGTHS
from flyrl.tasks.terms import failure_info
from flyrl.validation import float_array, random_seed, whole_number

__all__ = ["BatchedEnv", "EnvConfig"]


class BatchedEnv:
    """A task on `num_envs` bodies; episodes end, but are reset only on request.

    Simulation i depends on its own seed and actions alone, to the bit: not on the number of
    simulations, nor on that of threads.

    Parameters
    ----------
    config
        The settings.
    num_envs
        Number of simulations.
    num_threads
        Native threads; 0 takes one per CPU.
    view
        Camera, overlay and size of pictures.

    Attributes
    ----------
    simulation
        The bodies, as episodes start and push them.
    state
        The bodies after the last decision; one that blew up is kept as it was before.
    episodes
        Last episode of each simulation.
    difficulty
        Difficulty of the episodes that are drawn, from 0 to 1, the usual one.
    max_decisions
        Decisions until the task truncates an episode; None without a time limit.
    """

    def __init__(
        self, config: EnvConfig, num_envs: int = 1, num_threads: int = 0, view: View = USUAL_VIEW
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 1, MOST_SIMS)
        self.config = config
        self.view = view
        self.task = config.resolved_task
        self.num_envs = num_envs
        self.simulation = Bodies(config, num_envs, num_threads)
        self._scores = TaskBatch(config, num_envs)
        self.max_decisions = self._scores.max_decisions
        self.episodes: list[Episode | None] = [None] * num_envs
        self.difficulty = 1.0
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._renderer: BodyRenderer | None = None
        self._is_closed = False
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
        self.simulation.start(chosen, episodes)
        is_first = not any(self.episodes)
        self._scores.start(chosen, episodes)
        for i, episode in zip(chosen, episodes, strict=True):
            self.episodes[i] = episode
        self.state = self._previous = self.batch.state()
        if is_first:
            check_terms(self.task, self.task_state())
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
        self._check_reset()
        all_goals = self._scores.goal
        chosen = np.arange(self.num_envs) if ids is None else np.asarray(ids, dtype=np.intp)
        all_goals[chosen] = float_array(
            "goals", goals, all_goals[chosen].shape, minimum=LENGTHS.low, maximum=LENGTHS.high
        )
        self.simulation.set_goals(chosen, all_goals[chosen])
        return self.observe()

    def draw_episode(self, i: int, seed: int | None = None) -> Episode:
        """Draw simulation i's episode: number `seed` if given, else its generator's next."""
        if seed is not None:
            self._rngs[i] = np.random.default_rng(random_seed(seed))
        else:
            rng = self._rngs[i] = self._rngs[i] or np.random.default_rng()
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
        actions = float_array("action", action, (self.num_envs, self.task.actions.size))
        self._check_reset()
        previous = self._previous = self.state
        moved: NDArray[np.intp] | slice = slice(None) if ids is None else ids
        self.command(self.simulation, actions, moved)
        self.batch.step(self.config.steps_per_decision, ids)
        now = self.batch.state()
        is_unstable = now.is_unstable
        if is_unstable.any():
            # what blew up is shown as it was before the decision, which then ends its episode
            passed = previous.time + self.config.decision_interval_s
            now = _where(is_unstable, replace(previous, time=passed), now)
        self.state = now
        return self._scores.decide(now, previous, self.batch.props(now.time), moved)

    def command(
        self,
        bodies: Bodies,
        actions: NDArray[np.float64],
        ids: NDArray[np.intp] | slice = slice(None),
    ) -> None:
        """Set actions, (n, k), and the pushes that are due now: of these bodies, or a copy."""
        wanted = self.task.actions.commands(actions[ids])
        if constant_s := self.task.drive_time_constant_s:
            held = self.state.command[ids]
            share = -math.expm1(-self.config.decision_interval_s / constant_s)
            wanted = held + share * (wanted - held)
        bodies.batch.set_command(wanted, ids)
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

    def _check_reset(self) -> None:
        if not any(self.episodes):
            raise RuntimeError("the environment must be reset first")

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on: physics, controllers, episodes, generators.

        Returns
        -------
        Nested dicts and lists of arrays, numbers and text, for `restore`.
        """
        return {
            "simulation": {"physics": self.batch.integration_state()},
            "state": {item.name: getattr(self.state, item.name) for item in fields(self.state)},
            **self._scores.snapshot(),
            "episodes": [episode and asdict(episode) for episode in self.episodes],
            "generators": [rng and rng.bit_generator.state for rng in self._rngs],
            "difficulty": self.difficulty,
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned, in an environment of the same settings."""
        records = snapshot["episodes"]
        self.episodes = [record and Episode(**record) for record in records]
        started = [i for i, episode in enumerate(self.episodes) if episode]
        if started:
            self.simulation.start(np.array(started), [*filter(None, self.episodes)])
        self.batch.restore(snapshot["simulation"]["physics"])
        self.state = self._previous = replace(self.state, **snapshot["state"])
        self._scores.restore(snapshot)
        self.simulation.set_goals(np.arange(self.num_envs), self._scores.goal)
        self._rngs = [state and generator(state) for state in snapshot["generators"]]
        self.difficulty = snapshot["difficulty"]

    def copy_from(self, other: "BatchedEnv", sims: Sequence[int]) -> Observation:
        """Put simulations where those of another environment are, in the middle of their episodes.

        From there both lead to the same, to the bit, under the same actions: this is how a planner
        tries actions out. Noise to come is copied, too.

        Parameters
        ----------
        other
            An environment of the same settings; it stays as it is.
        sims
            Simulation of `other` for each one here, (num_envs,).

        Returns
        -------
        The observation of all simulations.

        Raises
        ------
        ValueError
            If there is not one simulation for each, or one was never reset.
        """
        rows = np.array(sims, dtype=np.intp)
        if rows.shape != (self.num_envs,) or any(other.episodes[i] is None for i in rows):
            raise ValueError(
                f"sims must be {self.num_envs} simulations that were reset, got {sims}"
            )
        self.restore(_rows_of(other.snapshot(), rows))
        return self.observe()

    def observe(self) -> Observation:
        """Observation of all simulations as they are now."""
        return self._scores.observe(self.task_state())

    def grounds(self) -> NDArray[np.int64]:
        """Seeds of the grounds that the simulations walk on, on random terrain; -1: none yet."""
        return np.array([-1 if each is None else each.ground_seed for each in self.episodes])

    def task_state(self) -> TaskState:
        """State that terms were computed from after the last decision, or a reset since."""
        self._check_reset()
        return self._scores.state(self.state, self._previous, self.batch.props(self.state.time))

    def failure_info(self) -> dict[str, NDArray[Any]]:
        """Further keys of `info` in a task with goals, (n,) each; none in any other."""
        return failure_info(self.task_state()) if self.task.has_goals else {}


def _rows_of(snapshot: Any, rows: NDArray[np.intp]) -> Any:
    """Some simulations of a snapshot; what is one for all stays."""
    if isinstance(snapshot, Mapping):
        # totals have a row per term of the reward, and a column per simulation
        return {
            name: each[:, rows] if name == "totals" else _rows_of(each, rows)
            for name, each in snapshot.items()
        }
    if isinstance(snapshot, list):
        return [snapshot[i] for i in rows]
    return snapshot[rows] if isinstance(snapshot, np.ndarray) else snapshot


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
