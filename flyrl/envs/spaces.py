"""Gymnasium spaces of a task."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from flyrl.controllers.controller import NUM_JOINTS, NUM_LEGS
from flyrl.tasks import JointTargets, Neurons, ObservationTerm, Task


def action_space(task: Task) -> spaces.Box | spaces.MultiDiscrete | spaces.Dict:
    """A number per component of an action, a whole number per muscle, or joints and adhesion."""
    actions = task.actions
    if isinstance(actions, JointTargets) and actions.is_dict:
        low, high = (bound[:NUM_JOINTS].astype(np.float32) for bound in actions.bounds)
        joints = spaces.Box(low, high, dtype=np.float32)
        return spaces.Dict({"joints": joints, "adhesion": spaces.MultiBinary(NUM_LEGS)})
    if isinstance(actions, Neurons) and actions.is_integer:
        return spaces.MultiDiscrete(list(actions.pools))
    low, high = (bound.astype(np.float32) for bound in actions.bounds)
    return spaces.Box(low, high, dtype=np.float32)


def action_vectors(task: Task, actions: Any) -> NDArray[np.float64]:
    """Actions of n simulations, as the action space has them, as one vector each, (n, size)."""
    if not isinstance(actions, Mapping):
        return np.asarray(actions, dtype=np.float64)
    parts = (np.asarray(actions[name], dtype=np.float64) for name in ("joints", "adhesion"))
    return np.concatenate([*parts], axis=1)


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
