"""What an environment asks of the bodies that it steps, whatever creature they are."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flyrl.simulation.batch import FlyBatch
from flyrl.simulation.state import FlyState
from flyrl.simulation.worms import WormBatch, WormState
from flyrl.tasks import Episode, EpisodeState

Ids = NDArray[np.intp]
BodyState = FlyState | WormState


class Simulation(Protocol):
    """Many bodies, started as episodes say and moved as actions say."""

    @property
    def batch(self) -> FlyBatch | WormBatch:
        """The bodies' physics."""
        ...

    def start(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Start episodes, one per simulation in `ids` (sorted).

        Raises
        ------
        ValueError
            If an episode asks for what these bodies cannot do.
        """
        ...

    def act(self, actions: NDArray[np.float64], now: Any, ids: Ids | None) -> None:
        """Set actions, (n, size), from the next physics step on, with the bodies as they are `now`.

        With `ids`, only those of these simulations.
        """
        ...

    def lead_to(self, ids: Ids, goals: NDArray[np.float64]) -> None:
        """Show that episodes lead elsewhere: x, y, mm, (k, 2)."""
        ...

    def state(self) -> Any:
        """Copy what the bodies look like now."""
        ...

    def seen(self, state: Any, previous: Any, **episodes: Any) -> EpisodeState:
        """What terms are computed from, with what the episodes say."""
        ...

    def snapshot(self) -> dict[str, Any]:
        """Copy everything that the future depends on."""
        ...

    def restore(self, snapshot: Mapping[str, Any], episodes: Sequence[Episode | None]) -> Any:
        """Put back what `snapshot` returned, in the midst of these episodes."""
        ...
