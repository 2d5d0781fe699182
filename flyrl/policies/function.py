"""A function of time and observation as a policy."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.policies.networks import vectors
from flyrl.tasks import Drives, Task


@runtime_checkable
class Law(Protocol):
    """A steering law: from the time, s, and what one fly observes to its drive."""

    def __call__(self, time_s: float, observation: Mapping[str, NDArray[np.float64]], /) -> Any:
        """Drive to the left and to the right legs; observations by the names of their terms."""
        ...


class FunctionPolicy:
    """A function `(time_s, observation) -> drive` as a policy; it is called for one fly at a time.

    Parameters
    ----------
    law
        Takes the time since the start of the episode, s, and a dict of arrays: the task's
        observation by the names of its terms. Returns what the leg controller takes: for most the
        drive (left, right); of a worm, an action of the task.
    task
        What it acts in.
    """

    def __init__(self, law: Law, task: Task) -> None:
        self._law = law
        self._task = task
        places = task.slices()
        self._places = [(term.name, places[term.name], term.shape) for term in task.observation]

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Action (a,) for an observation (k,), or (n, a) for (n, k).

        Parameters
        ----------
        observation
            Of one fly, or of many.
        state
            Decisions since the start of each episode, (n,), as the call before returned them; None
            starts at 0.
        episode_start
            Where episodes start anew, (n,).
        deterministic
            Without effect.

        Raises
        ------
        ValueError
            What the function returns has another shape.
        """
        values = vectors(observation)
        rows = np.atleast_2d(values)
        decisions = np.zeros(len(rows), np.int64) if state is None else np.array(state)
        if episode_start is not None:
            decisions[np.atleast_1d(np.asarray(episode_start, dtype=bool))] = 0
        interval_s = self._task.decision_interval_s or 0.0
        actions = np.stack(
            [
                self._action(int(count) * interval_s, row)
                for count, row in zip(decisions, rows, strict=True)
            ]
        )
        return (actions if values.ndim == 2 else actions[0]), decisions + 1

    def _action(self, time_s: float, row: NDArray[np.float64]) -> NDArray[Any]:
        shown = {name: row[place].reshape(shape) for name, place, shape in self._places}
        given = np.asarray(self._law(time_s, shown), dtype=np.float64)
        actions = self._task.actions
        if given.shape != (actions.size,):
            raise ValueError(
                f"a steering law must return {actions.size} numbers, got shape {given.shape}"
            )
        # as precise as an action that a network gives
        return actions.of(given).astype(np.float32) if isinstance(actions, Drives) else given


def takes(function: Callable[..., Any], count: int) -> bool:
    """Whether a function can be called with so many arguments by position, and no others."""
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        return False
    except ValueError:  # of C's, without a signature
        return count == 1
    return True
