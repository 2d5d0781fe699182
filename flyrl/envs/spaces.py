"""Gymnasium spaces of a task."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from flyrl.tasks import Neurons, ObservationTerm, Task


def action_space(task: Task) -> spaces.Box | spaces.MultiDiscrete:
    """A number per component of an action, or a whole number per muscle."""
    actions = task.actions
    if isinstance(actions, Neurons) and actions.is_integer:
        return spaces.MultiDiscrete(list(actions.pools))
    return spaces.Box(actions.low, actions.high, (actions.size,), np.float32)


def observation_space(task: Task) -> spaces.Box | spaces.Dict:
    """One vector, or a dict (see `Task.is_flat`); finite bounds, to which terms are clipped."""
    if task.is_flat:
        return _vector(task.observation)
    if task.has_goals:
        goals, others = task.observation[:2], task.observation[2:]
        return spaces.Dict({**_by_name(goals), "observation": _vector(others)})
    return spaces.Dict(_by_name(task.observation))


def _by_name(terms: Sequence[ObservationTerm]) -> dict[str, spaces.Space[Any]]:
    return {term.name: spaces.Box(term.low, term.high, term.shape, np.float32) for term in terms}


def _vector(terms: Sequence[ObservationTerm]) -> spaces.Box:
    low = np.concatenate([np.full(term.size, term.low, np.float32) for term in terms])
    high = np.concatenate([np.full(term.size, term.high, np.float32) for term in terms])
    return spaces.Box(low, high, dtype=np.float32)
