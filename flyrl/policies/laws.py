"""Policies that were not learned, by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Final

import numpy as np

from flyrl.controllers import CONTROLLERS
from flyrl.controllers.reflexes import ReflexesName
from flyrl.entry_points import is_entry_point
from flyrl.policies.fixed import (
    ClosedLoop,
    ConstantDrive,
    FixedPolicy,
    OpenLoop,
    Pursuit,
    Relaxed,
    WormCPG,
    WormReflex,
)
from flyrl.tasks import (
    ACHIEVED_GOAL,
    DESIRED_GOAL,
    DRIVE_HIGH,
    DRIVE_LOW,
    TASKS,
    Drives,
    Task,
)
from flyrl.tasks.terms import DISTANCE_UNIT, TIME_UNIT
from flyrl.validation import FloatArray, within


@dataclass(frozen=True)
class FixedLaw:
    """A law that steers, what it needs, and the legs that it is compared on.

    Attributes
    ----------
    legs
        The leg controller that evaluations give it; None of a worm.
    text
        What steers it, in words.
    make
        Makes that for a task.
    sees
        Observation terms that the task must show: all of one of these sets.
    reflexes
        Of the hybrid controller; None takes those that go with the body.
    is_usual
        Whether it takes part in evaluations unless others were asked for.
    """

    legs: str | None
    text: str
    make: Callable[[Task], FixedPolicy]
    sees: tuple[tuple[str, ...], ...] = ()
    reflexes: ReflexesName | None = None
    is_usual: bool = True

    def goes_with(self, task: Task) -> bool:
        """Whether the task is for its creature, and shows what it needs."""
        if isinstance(task.actions, Drives) != (self.legs is not None):
            return False
        shown = task.slices()
        return not self.sees or any(shown.keys() >= set(terms) for terms in self.sees)


@dataclass(eq=False)
class UnhurriedPursuit(Pursuit):
    """Turn towards the target, and walk no faster than the time that is left asks for.

    On rough ground haste makes a fly fall. The drive ahead is the one with which it would reach the
    target, or the finish line, `reserve` before the time limit, kept between `slowest` and
    `forward`.

    Parameters
    ----------
    task
        What it acts in; it shows `target_direction`, `time_left` and a distance: `target_distance`
        or `finish_distance`.
    slowest, forward
        Bounds of the drive ahead.
    speed
        Speed towards the target that a drive of 1 is expected to bring about on rough ground, turns
        and stumbles included, mm/s.
    reserve
        Time that is kept for turns, s.
    weakest, strongest
        Bounds of the drive; a side may be as strong as the drive ahead, too.
    gain
        As of `Pursuit`.
    """

    _: KW_ONLY
    slowest: float = 0.8
    forward: float = 1.3
    speed: float = 8.0
    reserve: float = 0.6
    weakest: float = 0.0
    strongest: float = 1.0

    def _drives(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        left_s = np.maximum(TIME_UNIT * shown["time_left"] - self.reserve, 1e-3)
        distance = shown["finish_distance" if "finish_distance" in shown else "target_distance"]
        way_mm = DISTANCE_UNIT * distance - self.task.parameters.get("reach", 0.0)
        ahead = np.clip(way_mm / left_s / self.speed, self.slowest, self.forward)
        return self._steered(shown, ahead, np.maximum(self.strongest, ahead))


QUICK_PURSUIT: Final = {"gain": 2.0, "forward": 1.5, "weakest": 0.0, "strongest": 1.5}
"""The quickest to a target of 16 settings (flat ground, 64 to 128 episodes that no evaluation has)
without a fall, at 0.81 s instead of 1.00. It follows 96 % of 200 paths, the usual turn 77."""

_QUICK_TASKS: Final = (
    "target", "target_unfiltered", "target_goal", "heading", "path", "slalom", "chase", "stop"
)  # fmt: skip

_GOALS: Final = (ACHIEVED_GOAL, DESIRED_GOAL, "compass")


def _held(left: float, right: float) -> Callable[[Task], FixedPolicy]:
    return lambda task: ConstantDrive(left, right, task)


def pursuit_brake(task: Task) -> float:
    """Distance from which on a pursuing fly brakes, mm; 0 where it need not stop, or sees none.

    At a path's end it pays to wait: that counts once the fly's mean distance to the path is small.
    """
    stops = task.name in ("stop", "path") and "target_distance" in task.slices()
    return 1.5 * task.parameters["reach"] if stops else 0.0


def _pursue(task: Task) -> FixedPolicy:
    tuned = QUICK_PURSUIT if task.name in _QUICK_TASKS else {}
    return Pursuit(task, brake=pursuit_brake(task), **tuned)


CROSSING: Final = {
    "slowest": 0.5, "forward": 1.5, "speed": 9.0, "reserve": 0.2, "weakest": 0.2, "strongest": 1.2
}  # fmt: skip
"""The best of 20 settings of `UnhurriedPursuit` over random blocks: it crosses them in 88 % of 672
training episodes, `pursuit` in 81 % of 288."""


def unhurried_settings(task: Task) -> Mapping[str, float]:
    """Settings of `UnhurriedPursuit` that go with a task, where they are not the usual ones."""
    return CROSSING if "finish_distance" in task.slices() else {}


_AHEAD: Final = "constant drive (1, 1)"
_WALK: Final = _held(1.0, 1.0)

FIXED: Final[Mapping[str, FixedLaw]] = {
    "cpg": FixedLaw("cpg", _AHEAD, _WALK),
    "rule_based": FixedLaw("rule_based", _AHEAD, _WALK),
    "hybrid": FixedLaw("hybrid", _AHEAD, _WALK),
    "hybrid_current": FixedLaw(
        "hybrid", f"{_AHEAD}, current reflexes", _WALK, reflexes="current", is_usual=False
    ),
    "hybrid_classic": FixedLaw(
        "hybrid", f"{_AHEAD}, classic reflexes", _WALK, reflexes="classic", is_usual=False
    ),
    "pursuit": FixedLaw(
        "hybrid",
        "proportional steering towards the target",
        _pursue,
        (("target_direction",), _GOALS),
    ),
    "unhurried": FixedLaw(
        "hybrid",
        "proportional steering towards the target, no faster than the time left asks for",
        lambda task: UnhurriedPursuit(task, brake=pursuit_brake(task), **unhurried_settings(task)),
        (
            ("target_direction", "target_distance", "time_left"),
            ("target_direction", "finish_distance", "time_left"),
        ),
    ),
    "open_loop": FixedLaw("hybrid", "drive that answers the command", OpenLoop, (("command",),)),
    "closed_loop": FixedLaw(
        "hybrid",
        "drive that answers the command, corrected by the velocity that is felt",
        ClosedLoop,
        (("command", "mean_velocity"),),
    ),
    "zero": FixedLaw("hybrid", "constant drive (0, 0)", _held(0.0, 0.0)),
    "worm_cpg": FixedLaw(None, "CPG that sends waves along the worm", WormCPG, (("heading",),)),
    "worm_reflex": FixedLaw(
        None, "reflex that recruits until the bend is right", WormReflex, (("bend_error",),)
    ),
    "relaxed": FixedLaw(None, "no muscle recruited", Relaxed),
}
"""Fixed laws by name. Besides, there is constant(left, right): any drive, held."""

_CONSTANT: Final = re.compile(r"constant\(\s*([^,\s]+)\s*,\s*([^,\s]+)\s*\)")


def split_legs(name: str) -> tuple[str, str | None]:
    """Name of what steers, and of the legs that it is put on: ("pursuit", "cpg") of pursuit@cpg.

    None stands for its usual legs. What follows a last @ and names no leg controller, as in a path,
    belongs to the name.
    """
    steering, _, legs = name.rpartition("@")
    is_legs = steering and (legs in CONTROLLERS or is_entry_point(legs))
    return (steering, legs) if is_legs else (name, None)


def is_law(name: str) -> bool:
    """Whether it is a name in `FIXED`, like constant(1.2, 0.4), or a controller of one's own."""
    return name in FIXED or is_entry_point(name) or _CONSTANT.fullmatch(name) is not None


def law_named(name: str) -> FixedLaw:
    """Law of a name in `FIXED`, like constant(1.2, 0.4), or module:attribute of a controller.

    Raises
    ------
    ValueError
        No such law, or a constant drive that is out of range.
    """
    if is_entry_point(name):
        return FixedLaw(name, _AHEAD, _WALK)
    return FIXED[name] if name in FIXED else _constant(name)


def fixed_policy(name: str, task: Task | None = None) -> FixedPolicy:
    """Policy that follows the law of a name; None takes the first task that the law goes with.

    Raises
    ------
    ValueError
        No such law, or the task does not show what it needs.
    """
    law = law_named(name)
    if task is None:
        task = next(each for each in (make() for make in TASKS.values()) if law.goes_with(each))
    if not law.goes_with(task):
        creature = "a worm" if law.legs is None else "flies"
        needed = " or ".join(", ".join(terms) for terms in law.sees) or "anything"
        raise ValueError(
            f"{name!r} needs a task for {creature} that shows {needed}, got {task.name!r}"
        )
    return law.make(task)


def _constant(name: str) -> FixedLaw:
    """Law with the drive that a name like constant(1.2, 0.4) says."""
    match = _CONSTANT.fullmatch(name)
    try:
        left, right = map(float, match.groups() if match else "")
    except ValueError:
        raise ValueError(f"{name!r} must hold two numbers, e.g. constant(1.2, 0.4)") from None
    for side in (left, right):
        within(f"drive of {name!r}", side, DRIVE_LOW, DRIVE_HIGH)
    return FixedLaw("hybrid", f"constant drive ({left:g}, {right:g})", _held(left, right))
