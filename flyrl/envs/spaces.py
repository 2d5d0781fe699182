"""Gymnasium spaces of a task."""

import numpy as np
from gymnasium import spaces

from flyrl.tasks import ObservationTerm, Task


def action_space(task: Task) -> spaces.Box:
    """Two components (left, right)."""
    return spaces.Box(task.action_low, task.action_high, (2,), np.float32)


def observation_space(task: Task) -> spaces.Box | spaces.Dict:
    """One vector, or a dict of arrays by term; finite bounds, to which terms are clipped."""
    if not task.is_flat:
        return spaces.Dict(
            {
                term.name: spaces.Box(term.low, term.high, term.shape, np.float32)
                for term in task.observation
            }
        )
    return spaces.Box(_bound(task, "low"), _bound(task, "high"), dtype=np.float32)


def _bound(task: Task, side: str) -> np.ndarray:
    def values(term: ObservationTerm) -> np.ndarray:
        return np.full(term.size, getattr(term, side), np.float32)

    return np.concatenate([values(term) for term in task.observation])
