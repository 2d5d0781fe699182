"""Noise of a fly's senses."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flyrl.tasks import Episode, ObservationTerm

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
