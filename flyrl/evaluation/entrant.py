"""Entrants of an evaluation: legs, and what steers them; the fixed ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from flyrl.controllers import Controller
from flyrl.controllers.controller import controller_named
from flyrl.envs.core import EnvConfig
from flyrl.evaluation.config import EvaluationConfig
from flyrl.policies.laws import FIXED, fixed_policy, is_law, law_named
from flyrl.rollouts import Policy
from flyrl.simulation.fly_scene import fit_controller
from flyrl.terrains import Terrain
from flyrl.validation import one_of

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


def controller_names(config: EvaluationConfig) -> tuple[str, ...]:
    """Names of the fixed entrants: those that were asked for, or the usual ones that can."""
    if config.controllers is not None:
        return config.controllers
    return tuple(
        name
        for name, fixed in FIXED.items()
        if fixed.is_usual and fixed.goes_with(config.resolved_task)
    )


def make_fixed(name: str, config: EvaluationConfig) -> Entrant:
    """Fixed entrant by its name.

    Raises
    ------
    ValueError
        There is no such name, the task does not show what it needs, or a drive is out of range.
    """
    task = config.resolved_task
    if not is_law(name):
        one_of("controllers", name, [*FIXED, "constant(left, right)"])
    try:
        fixed = law_named(name)
        policy = fixed_policy(name, fixed, task)
    except ValueError as error:
        raise ValueError(f"controllers: {error}") from error
    controller = None
    if config.legs is not None and fixed.legs is not None:
        reflexes = {"reflexes": fixed.reflexes} if fixed.reflexes else {}
        body = config.env(config.terrains[0]).fly_scene.body
        controller = fit_controller(controller_named(fixed.legs, **reflexes), body)
    record = {
        "name": name,
        "kind": "fixed",
        "leg_controller": fixed.legs,
        "policy": fixed.text,
        "source": None,
        "sha256": None,
        "sees": next(
            (list(terms) for terms in fixed.sees if task.slices().keys() >= set(terms)), []
        ),
        "controller_config": controller and asdict(controller),
    }
    return Entrant(name, controller, policy, None, record)
