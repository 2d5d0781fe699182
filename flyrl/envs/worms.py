"""Worms as an environment steps them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.config import EnvConfig
from flyrl.simulation.randomisation import UNVARIED
from flyrl.simulation.worms import WormBatch, WormSceneConfig, WormState, build_worm_scene
from flyrl.tasks import Episode, WormTaskState
from flyrl.tasks.episode import NO_OSCILLATORS

Ids = NDArray[np.intp]

_OF_FLIES: Final = {
    "init_phases": NO_OSCILLATORS,
    "init_magnitudes": NO_OSCILLATORS,
    "pushes": (),
    "ground": None,
    "props": (),
}
"""What an episode says of flies alone, and what it says where it says nothing."""


class Worms:
    """Worms of one environment.

    Parameters
    ----------
    config, scene
        What to simulate, and its scene.
    num_envs, num_threads
        Number of worms, and of native threads; 0 takes one per CPU.
    """

    def __init__(
        self, config: EnvConfig, scene: WormSceneConfig, num_envs: int, num_threads: int
    ) -> None:
        self.batch = WormBatch(build_worm_scene(scene), num_envs, num_threads)
        self._config = config
        self._joints = scene.body.joints
        self._hangs = scene.body.mount == "hanging"

    def start(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Start episodes, one per simulation in `ids` (sorted).

        Raises
        ------
        ValueError
            If an episode asks for something that only flies have, not for one angle per joint, or
            for another place of a hanging worm.
        """
        for episode in episodes:
            self._check(episode)
        straight = (0.0,) * self._joints
        self.batch.reset(
            ids,
            np.array([episode.spawn_position_w[:2] for episode in episodes]),
            np.array([episode.spawn_yaw for episode in episodes]),
            np.array([episode.joint_angles or straight for episode in episodes]),
        )

    def act(self, actions: NDArray[np.float64], now: WormState, ids: Ids | None) -> None:
        """Set actions, (n, muscles), from the next physics step on."""
        moved: Ids | slice = slice(None) if ids is None else ids
        self.batch.set_neurons(self._config.resolved_task.actions.commands(actions[moved]), moved)

    def lead_to(self, ids: Ids, goals: NDArray[np.float64]) -> None:
        """Do nothing: a worm's scene shows no goal."""

    def state(self) -> WormState:
        """Copy what the worms look like now."""
        return self.batch.state()

    def seen(self, state: WormState, previous: WormState, **episodes: Any) -> WormTaskState:
        """What terms are computed from, with what the episodes say."""
        return WormTaskState(worm=state, previous=previous, **episodes)

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on."""
        return {"physics": self.batch.integration_state()}

    def restore(self, snapshot: Mapping[str, Any], episodes: Sequence[Episode | None]) -> None:
        """Put back what `snapshot` returned, in the midst of these episodes."""
        self.batch.restore(snapshot["physics"])

    def _check(self, episode: Episode) -> None:
        for name, nothing in _OF_FLIES.items():
            if (given := getattr(episode, name)) != nothing:
                raise ValueError(f"{name} of an episode of a worm must be {nothing}, got {given}")
        if replace(episode.randomisation, sensor_noise=0.0) != UNVARIED:
            raise ValueError(
                "randomisation of an episode of a worm must be of its senses alone, got "
                f"{episode.randomisation}"
            )
        for name, place in (
            ("spawn_position", episode.spawn_position_w[:2]),
            ("spawn_yaw", episode.spawn_yaw),
        ):
            if self._hangs and np.any(place):
                raise ValueError(f"{name} of a hanging worm must be 0, got {place}")
        if len(episode.joint_angles) not in (0, self._joints):
            raise ValueError(
                f"joint_angles of the episode must be {self._joints} angles, or none, got "
                f"{len(episode.joint_angles)}"
            )
