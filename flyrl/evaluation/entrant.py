"""Who takes part in an evaluation: legs, and what steers them."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from flyrl.controllers import Controller
from flyrl.envs.core import EnvConfig
from flyrl.evaluation.config import EvaluationConfig
from flyrl.rollouts import Policy
from flyrl.terrains import Terrain

NAME_LENGTH: Final = 60
"""Characters of a name at most, before a number that makes it unique."""


@dataclass(frozen=True)
class Entrant:
    """A leg controller, if there are legs, and the policy that steers it.

    Attributes
    ----------
    name
        Unique among the entrants of an evaluation.
    controller
        Of the legs; None of a worm.
    policy
        Of the descending drive, or of the muscles.
    decision_interval
        s for which a decision is held; None takes the task's.
    record
        Where the entrant comes from, as plain JSON values.
    """

    name: str
    controller: Controller | None
    policy: Policy
    decision_interval: float | None
    record: Mapping[str, Any]

    def env(self, config: EvaluationConfig, terrain: Terrain) -> EnvConfig:
        """Environment that the entrant walks in."""
        return dataclasses.replace(
            config.env(terrain),
            controller=self.controller,
            decision_interval=self.decision_interval,
        )


def free_name(name: str, taken: Collection[str]) -> str:
    """`name`, or `name-2`, `name-3`, … where that is taken.

    Names come from files of others and reach pages, spreadsheets and terminals. Of them only
    letters, digits and `_ . ( ) + - space` are kept, at most `NAME_LENGTH` of them and starting
    with a letter or digit; `unnamed` stands where nothing is left.
    """
    kept = "".join(each if each.isalnum() or each in "_.()+- " else "_" for each in name)
    name = kept.lstrip("_.()+- ")[:NAME_LENGTH].rstrip() or "unnamed"
    if name not in taken:
        return name
    return next(f"{name}-{i}" for i in range(2, len(taken) + 3) if f"{name}-{i}" not in taken)
