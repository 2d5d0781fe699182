"""Drives that policies choose by the bearing of what the task leads to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.core import BatchedEnv
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrants import make_entrants
from flyrl.tasks import Drives
from flyrl.terrains import Terrain

FloatArray = NDArray[np.float64]

BEARINGS_DEG: Final = tuple(range(-180, 181, 5))

STARTS: Final = 16
"""Episodes at most whose starts are shown to a policy."""


@dataclass(frozen=True, eq=False)
class Steering:
    """Drives over bearings.

    Attributes
    ----------
    bearings_deg
        Left positive, shape (k,).
    drives
        Left and right drive by entrant, shape (starts, k, 2).
    """

    bearings_deg: FloatArray
    drives: Mapping[str, FloatArray]


def measure_steering(config: EvaluationConfig, terrain: Terrain) -> Steering | None:
    """Show each policy every bearing at the starts of episodes; note the drives it answers with.

    All other senses are those of the start. Asked are learned policies and fixed ones that see the
    bearing; None where there is none of them, or where the task shows no bearing.

    Parameters
    ----------
    config
        Of the evaluation.
    terrain
        Where the episodes start.
    """
    task = config.resolved_task
    shown = next((term.name for term in task.observation if term.is_bearing), None)
    if shown is None or not task.is_flat or not isinstance(task.actions, Drives):
        return None
    asked = [
        each
        for each in make_entrants(config)
        if each.record["kind"] == "learned" or shown in each.record.get("sees", ())
    ]
    if not asked:
        return None
    episodes = config.draw_episodes(terrain)[:STARTS]
    env = BatchedEnv(config.env(terrain), len(episodes), config.num_threads)
    starts = env.reset(episodes=episodes)
    assert not isinstance(starts, dict)  # the task is flat
    bearings = np.radians(BEARINGS_DEG)
    views = np.repeat(starts, len(bearings), axis=0)
    views[:, task.slices()[shown]] = np.tile(
        np.stack([np.cos(bearings), np.sin(bearings)], axis=1), (len(episodes), 1)
    )
    shape = (len(episodes), len(bearings), 2)
    return Steering(
        np.array(BEARINGS_DEG, dtype=np.float64),
        {
            each.name: task.actions.commands(each.policy.predict(views)[0]).reshape(shape)
            for each in asked
        },
    )
