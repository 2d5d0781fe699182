"""Fixed entrants: leg controllers with a drive, or muscles with a rhythm, that nobody learned."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from flyrl.controllers.leg_controller import ControllerName
from flyrl.controllers.reflexes import ReflexesName
from flyrl.evaluation.config import EvaluationConfig
from flyrl.evaluation.entrant import Entrant
from flyrl.policies import (
    ConstantDrive,
    OpenLoop,
    Pursuit,
    PursuitOfGoal,
    Relaxed,
    WormCPG,
    WormReflex,
)
from flyrl.rollouts import Policy
from flyrl.tasks import ACHIEVED_GOAL, DESIRED_GOAL, DRIVE_HIGH, DRIVE_LOW, Drives, Neurons, Task
from flyrl.validation import one_of, within


@dataclass(frozen=True)
class FixedEntrant:
    """A fixed entrant: its legs, what steers them, and what that needs.

    Attributes
    ----------
    legs
        The leg controller; None of a worm.
    text
        What steers it, in words.
    make
        Makes that for a task.
    sees
        Observation terms that the task must show: all of one of these sets.
    reflexes
        Of the hybrid controller; None takes those that go with the body.
    is_usual
        Whether it takes part unless others were asked for.
    """

    legs: ControllerName | None
    text: str
    make: Callable[[Task], Policy]
    sees: tuple[tuple[str, ...], ...] = ()
    reflexes: ReflexesName | None = None
    is_usual: bool = True

    def goes_with(self, task: Task) -> bool:
        """Whether the task is for its creature, and shows what it needs."""
        if isinstance(task.actions, Drives) != (self.legs is not None):
            return False
        shown = task.slices()
        return not self.sees or any(shown.keys() >= set(terms) for terms in self.sees)


_QUICK_PURSUIT: Final = {"gain": 2.0, "forward": 1.5, "weakest": 0.0, "strongest": 1.5}
"""The quickest to a target of 16 settings (flat ground, 64 to 128 episodes that no evaluation has)
without a fall, at 0.81 s instead of 1.00; on a path the literature's turn keeps closer to it."""

_GOALS: Final = (ACHIEVED_GOAL, DESIRED_GOAL, "compass")


def _walk(task: Task) -> Policy:
    return ConstantDrive(1.0, 1.0, task.actions.of)


def _stand(task: Task) -> Policy:
    return ConstantDrive(0.0, 0.0, task.actions.of)


def _pursue(task: Task) -> Policy:
    tuned = _QUICK_PURSUIT if task.name in ("target", "target_goal", "heading") else {}
    shown = task.slices()
    if "target_direction" in shown:
        return Pursuit(shown["target_direction"], task.actions.of, **tuned)
    achieved, desired, compass = (shown[name] for name in _GOALS)
    return PursuitOfGoal(achieved, desired, compass, task.actions.of, **tuned)


def _wave(task: Task) -> Policy:
    actions, interval_s = _muscles(task)
    return WormCPG(actions, interval_s)


def _bend(task: Task) -> Policy:
    actions, interval_s = _muscles(task)
    return WormReflex(actions, interval_s, task.slices()["bend_error"])


def _relax(task: Task) -> Policy:
    actions, _ = _muscles(task)
    return Relaxed(actions)


def _muscles(task: Task) -> tuple[Neurons, float]:
    """Actions of a task for worms, and s from one to the next."""
    actions, interval_s = task.actions, task.decision_interval_s
    assert isinstance(actions, Neurons) and interval_s is not None  # goes_with says so
    return actions, interval_s


def _follow_command(task: Task) -> Policy:
    return OpenLoop(task.slices()["command"], task.actions.of)


_AHEAD: Final = "constant drive (1, 1)"

FIXED: Final[Mapping[str, FixedEntrant]] = {
    "cpg": FixedEntrant("cpg", _AHEAD, _walk),
    "rule_based": FixedEntrant("rule_based", _AHEAD, _walk),
    "hybrid": FixedEntrant("hybrid", _AHEAD, _walk),
    "hybrid_current": FixedEntrant(
        "hybrid", f"{_AHEAD}, current reflexes", _walk, reflexes="current", is_usual=False
    ),
    "hybrid_classic": FixedEntrant(
        "hybrid", f"{_AHEAD}, classic reflexes", _walk, reflexes="classic", is_usual=False
    ),
    "pursuit": FixedEntrant(
        "hybrid",
        "proportional steering towards the target",
        _pursue,
        (("target_direction",), _GOALS),
    ),
    "open_loop": FixedEntrant(
        "hybrid", "drive that answers the command", _follow_command, (("command",),)
    ),
    "zero": FixedEntrant("hybrid", "constant drive (0, 0)", _stand),
    "worm_cpg": FixedEntrant(None, "CPG that sends waves along the worm", _wave, (("heading",),)),
    "worm_reflex": FixedEntrant(
        None, "reflex that recruits until the bend is right", _bend, (("bend_error",),)
    ),
    "relaxed": FixedEntrant(None, "no muscle recruited", _relax),
}
"""Fixed entrants by name. Besides, there is constant(left, right): any drive, held."""

_CONSTANT: Final = re.compile(r"constant\(\s*([^,\s]+)\s*,\s*([^,\s]+)\s*\)")


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
    fixed = _constant(name) or FIXED[one_of("controllers", name, [*FIXED, "constant(left, right)"])]
    task = config.resolved_task
    if not fixed.goes_with(task):
        creature = "a worm" if fixed.legs is None else "flies"
        needed = " or ".join(", ".join(terms) for terms in fixed.sees) or "anything"
        raise ValueError(
            f"controllers: {name!r} needs a task for {creature} that shows {needed}, got "
            f"{task.name!r}"
        )
    controller = config.legs
    if controller is not None and fixed.legs is not None:
        controller = dataclasses.replace(
            controller, name=fixed.legs, reflexes=fixed.reflexes or controller.reflexes
        )
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
        "controller_config": controller and dataclasses.asdict(controller),
    }
    return Entrant(name, controller, fixed.make(task), None, record)


def _constant(name: str) -> FixedEntrant | None:
    """Entrant with the drive that a name like constant(1.2, 0.4) tells; None of another name."""
    match = _CONSTANT.fullmatch(name)
    if match is None:
        return None
    try:
        left, right = (float(side) for side in match.groups())
    except ValueError:
        raise ValueError(
            f"controllers: {name!r} must hold two numbers, e.g. constant(1.2, 0.4)"
        ) from None
    for side in (left, right):
        within(f"controllers: drive of {name!r}", side, DRIVE_LOW, DRIVE_HIGH)
    return FixedEntrant(
        "hybrid",
        f"constant drive ({left:g}, {right:g})",
        lambda task: ConstantDrive(left, right, task.actions.of),
    )
