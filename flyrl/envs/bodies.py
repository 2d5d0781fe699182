"""Bodies as an environment steps them: with the ground, the pushes and the delays of episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.config import EnvConfig
from flyrl.simulation.batch import Batch, Ids
from flyrl.simulation.flies import FlyBatch, FlyState
from flyrl.simulation.randomisation import UNVARIED
from flyrl.simulation.scene import build_scene
from flyrl.tasks import Episode, ObservationTerm
from flyrl.tasks.episode import PUSH_ARM, PUSH_S

_STREAM: Final = 171_006_538
"""Sets the generators of the noise apart from the task's, which have the same seed."""


class SensorNoise:
    """Normal noise on the observation terms that have a spread, anew for every decision.

    Each simulation draws it from a generator of its own, seeded with its episode.

    Parameters
    ----------
    terms
        Of the observation.
    num_envs
        Number of simulations.

    Attributes
    ----------
    is_on
        Whether there is any noise now.
    """

    def __init__(self, terms: Sequence[ObservationTerm], num_envs: int) -> None:
        spreads = [term.spreads() for term in terms]
        self._spread = np.concatenate([spread.ravel() for spread in spreads])
        ends = np.cumsum([spread.size for spread in spreads])
        self._where = {
            term.name: (slice(int(end) - spread.size, int(end)), (num_envs, *spread.shape))
            for term, spread, end in zip(terms, spreads, ends, strict=True)
        }
        self._strength = np.zeros(num_envs)
        self._noise = np.zeros((num_envs, self._spread.size))
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self.is_on = False

    def start(self, ids: NDArray[np.intp], episodes: Sequence[Episode]) -> None:
        """Begin episodes: draw the noise of their first observation."""
        self._strength[ids] = [episode.randomisation.sensor_noise for episode in episodes]
        self.is_on = bool(self._strength.any())
        for i, episode in zip(ids, episodes, strict=True):
            is_noisy = self._strength[i] > 0.0
            self._rngs[i] = np.random.default_rng([episode.seed, _STREAM]) if is_noisy else None
        self._noise[ids] = 0.0
        self.draw(ids)

    def draw(self, ids: NDArray[np.intp] | slice) -> None:
        """Draw the noise of the next observation of some simulations."""
        for i in np.arange(len(self._rngs))[ids]:
            rng = self._rngs[i]
            if rng is not None:
                drawn = rng.standard_normal(self._spread.size)
                self._noise[i] = self._strength[i] * self._spread * drawn

    def of(self, name: str) -> NDArray[np.float64]:
        """Noise of a term, (n, *shape)."""
        where, shape = self._where[name]
        return self._noise[:, where].reshape(shape)

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future noise depends on."""
        return {
            "strength": self._strength.copy(),
            "noise": self._noise.copy(),
            "generators": [rng and rng.bit_generator.state for rng in self._rngs],
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put back what `snapshot` returned."""
        self._strength[:] = snapshot["strength"]
        self._noise[:] = snapshot["noise"]
        self._rngs = [state and generator(state) for state in snapshot["generators"]]
        self.is_on = bool(self._strength.any())


def generator(state: Mapping[str, Any]) -> np.random.Generator:
    """Generator that goes on from the state of another."""
    rng = np.random.default_rng()
    rng.bit_generator.state = state
    return rng


ABOVE_GROUND: Final = 0.02
"""mm; a marker lies that far above the ground, to be seen."""


_DEFAULTS: Final = {item.name: item.default for item in fields(Episode)}


class Bodies:
    """Bodies of one environment, started and pushed as episodes say.

    Parameters
    ----------
    config
        What to simulate.
    num_envs, num_threads
        Number of bodies, and of native threads; 0 takes one per CPU.

    Attributes
    ----------
    batch
        Their physics.
    pushes
        Start, s, and strength, µN, to the left, of each episode's pushes, (num_envs, 2 k).
    """

    def __init__(self, config: EnvConfig, num_envs: int, num_threads: int) -> None:
        scene = config.scene
        self.batch: Batch = scene.batch_class(build_scene(scene), num_envs, num_threads)
        self._config = config
        self._scene = scene
        self.pushes = np.zeros((num_envs, 0))
        self._decisions_per_push = max(1, round(PUSH_S / config.decision_interval_s))

    def start(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Start episodes, one per simulation in `ids` (sorted).

        Raises
        ------
        ValueError
            If an episode asks for what these bodies cannot do, brings a ground where the terrain is
            not random, or more latency than the settings have.
        """
        for episode in episodes:
            self._check(episode)
        self._lay_ground(ids, episodes)
        self.batch.vary(ids, [episode.randomisation for episode in episodes])
        self.batch.start(ids, episodes)
        self._set_pushes(ids, episodes)
        self._set_props(ids, episodes)

    def set_goals(self, ids: Ids, goals: NDArray[np.float64]) -> None:
        """Put the props that stand where episodes lead to elsewhere: x, y, mm, (k, 2)."""
        starts = self.batch.prop_starts[ids]
        for row, sim, goal in zip(starts, ids, goals, strict=True):
            self._put_at_goal(row, int(sim), goal)
        self.batch.set_props(ids, starts)

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on."""
        return {"physics": self.batch.integration_state(), "pushes": self.pushes.copy()}

    def restore(self, snapshot: Mapping[str, Any], episodes: Sequence[Episode | None]) -> None:
        """Put back what `snapshot` returned, during these episodes."""
        started = [i for i, episode in enumerate(episodes) if episode is not None]
        self._lay_ground(np.array(started, dtype=np.intp), [*filter(None, episodes)])
        self.batch.vary(
            np.arange(len(episodes)),
            [episode.randomisation if episode else UNVARIED for episode in episodes],
        )
        self.batch.restore(snapshot["physics"])
        self._set_props(np.array(started, dtype=np.intp), [*filter(None, episodes)])
        self.pushes = snapshot["pushes"]

    def _lay_ground(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Lay the ground of episodes that start, where the terrain is random."""
        terrain = self._scene.terrain
        if terrain.random and len(ids):
            grounds = [
                terrain.draw(episode.ground_seed, episode.difficulty) for episode in episodes
            ]
            self.batch.set_ground(ids, grounds)
            return
        for episode in episodes:
            if episode.ground is not None:
                raise ValueError(
                    f"ground of the episode is {episode.ground}; it must be None where "
                    f"terrain.random is false, as on {terrain.name!r}"
                )

    def _set_props(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Put the props of episodes where these say."""
        if not self._scene.props:
            return
        placed = [i for i, prop in enumerate(self._scene.props) if not prop.at_goal]
        for sim, episode in zip(ids, episodes, strict=True):
            if len(episode.props) != 3 * len(placed):
                raise ValueError(
                    f"props of the episode must be x, y and z of {len(placed)} props, got "
                    f"{len(episode.props)} numbers"
                )
            row = self.batch.prop_starts[sim]
            row[placed] = np.reshape(episode.props, (-1, 3))
            self._put_at_goal(row, int(sim), episode.goal)
        self.batch.set_props(ids, self.batch.prop_starts[ids])

    def _put_at_goal(self, row: NDArray[np.float64], sim: int, goal: Sequence[float]) -> None:
        """Put props of one simulation, (props, 3), at its goal, if it has one."""
        terrain = self._scene.terrain
        for place, prop in zip(row, self._scene.props, strict=True):
            if prop.at_goal and len(goal):
                x, y = goal[0], goal[1]
                top = terrain.top_at(self.batch.ground(sim), x, y)
                foot = terrain.base_height if top is None else top
                place[:] = (x, y, foot + prop.height / 2 + ABOVE_GROUND)

    def _check(self, episode: Episode) -> None:
        """Raise ValueError if an episode asks for what these bodies or the settings do not have."""
        body = f"of an episode of a {self.batch.creature}"
        for name in self.batch.needless:
            given, nothing = getattr(episode, name), _DEFAULTS[name]
            if given != nothing:
                raise ValueError(f"{name} {body} must be {nothing}, got {given}")
        drawn = episode.randomisation
        if not self.batch.has_legs and replace(drawn, sensor_noise=0.0) != UNVARIED:
            raise ValueError(f"randomisation {body} must be of its senses alone, got {drawn}")
        longest = self._config.resolved_randomisation.longest_latency
        if drawn.drive_latency > longest:
            raise ValueError(
                f"randomisation.drive_latency is {drawn.drive_latency} s; the environment's own "
                f"allows at most {longest} s"
            )

    def _set_pushes(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Note the pushes of episodes that start; a push of 0 µN is none."""
        most = max(len(episode.pushes) for episode in episodes)
        missing = max(0, most - self.pushes.shape[1])
        self.pushes = np.pad(self.pushes, ((0, 0), (0, missing)))
        self.pushes[ids] = 0.0
        for i, episode in zip(ids, episodes, strict=True):
            self.pushes[i, : len(episode.pushes)] = episode.pushes

    def push(self, now: FlyState, moved: Ids | slice) -> None:
        """Push flies as hard as is due in this decision, with all of them as they are `now`."""
        start, strength = self.pushes[:, ::2], self.pushes[:, 1::2]
        duration = self._decisions_per_push * self._config.decision_interval_s
        since = now.time[:, None] - start
        # but for rounding: a push that starts with a decision lasts no decision more
        is_due = (since > -1e-6) & (since < duration - 1e-6)
        to_the_left = np.where(is_due, strength, 0.0).sum(axis=1) * (PUSH_S / duration)
        yaw = now.yaw
        force_w = to_the_left[:, None] * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
        cast(FlyBatch, self.batch).push(force_w[moved], -PUSH_ARM * to_the_left[moved], moved)
