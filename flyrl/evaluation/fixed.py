"""Fixed entrants: leg controllers with a drive, or muscles with a rhythm, that nobody learned."""

from dataclasses import asdict

from flyrl.controllers.controller import controller_named
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.policies.laws import FIXED, fixed_policy, is_law, law_named
from flyrl.simulation.fly_scene import fit_controller
from flyrl.validation import one_of


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
