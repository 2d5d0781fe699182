"""Policies that were not learned, by name: constant drives, steering laws, rhythms of worms."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.controllers.reflexes import ReflexesName
from flyrl.entry_points import is_entry_point
from flyrl.policies.networks import vectors
from flyrl.policies.worm import Relaxed, WormCPG, WormReflex
from flyrl.tasks import (
    ACHIEVED_GOAL,
    DESIRED_GOAL,
    DRIVE_HIGH,
    DRIVE_LOW,
    TASK_NAMES,
    Drives,
    Neurons,
    Task,
    task_named,
)
from flyrl.validation import within

DriveToAction = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From drives (..., 2), left then right, to the actions (..., 2) that command them."""


class _FixedPolicy:
    """What answers each observation with a drive of its own making."""

    def __init__(self, drive_to_action: DriveToAction) -> None:
        self._drive_to_action = drive_to_action

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Action (2,) for an observation (k,), or (n, 2) for (n, k); and `state`.

        The observation may be the dict of a task with goals too.
        """
        drive = self._drive(vectors(observation))
        return np.array(self._drive_to_action(drive), dtype=np.float32), state

    def _drive(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Drives (..., 2) for observations (..., k)."""
        raise NotImplementedError


class ConstantDrive(_FixedPolicy):
    """The same drive at every decision.

    Parameters
    ----------
    left, right
        Drive to the left and to the right legs; (1, 1) walks, (0, 0) stands.
    drive_to_action
        Mapping of the task.
    """

    def __init__(self, left: float, right: float, drive_to_action: DriveToAction) -> None:
        super().__init__(drive_to_action)
        self._sides = np.array([left, right])

    def _drive(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.broadcast_to(self._sides, (*observation.shape[:-1], 2))


class Pursuit(_FixedPolicy):
    """Turn towards the target, the more the further it lies to the side.

    With bearing b (rad, positive to the left), the left drive is `forward - gain * b` and the right
    one `forward + gain * b`, both kept between `weakest` and `strongest`.

    Parameters
    ----------
    direction
        Where in the flat observation the unit vector towards the target stands: forward, left (body
        frame).
    drive_to_action
        Mapping of the task.
    gain
        Drive per rad of bearing.
    forward
        Drive of both sides when the target is straight ahead.
    weakest, strongest
        Bounds of the drive. The default turn, (1.2, 0.2), is that of the literature; stronger
        differences can tip the fly over.
    """

    def __init__(
        self,
        direction: slice,
        drive_to_action: DriveToAction,
        *,
        gain: float = 1.0,
        forward: float = 1.0,
        weakest: float = 0.2,
        strongest: float = 1.2,
    ) -> None:
        super().__init__(drive_to_action)
        self._direction = direction
        self._gain = gain
        self._forward = forward
        self._bounds = (weakest, strongest)

    def _drive(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        direction = self._towards(observation)
        bearing = np.arctan2(direction[..., 1], direction[..., 0])
        turn = self._gain * bearing[..., None] * np.array([-1.0, 1.0])
        return np.asarray(np.clip(self._forward + turn, *self._bounds))

    def _towards(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (..., 2) towards the target, forward and left."""
        return observation[..., self._direction]


class PursuitOfGoal(Pursuit):
    """The same, of a goal that is observed as a place in the world.

    Parameters
    ----------
    achieved, desired
        Where in the flat observation x and y of the fly and of the target stand (world frame).
    compass
        Where the cosine and sine of the heading stand.
    drive_to_action, **tuned
        As of `Pursuit`.
    """

    def __init__(
        self,
        achieved: slice,
        desired: slice,
        compass: slice,
        drive_to_action: DriveToAction,
        **tuned: float,
    ) -> None:
        super().__init__(desired, drive_to_action, **tuned)
        self._achieved = achieved
        self._compass = compass

    def _towards(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        offset_w = observation[..., self._direction] - observation[..., self._achieved]
        cos, sin = np.moveaxis(observation[..., self._compass], -1, 0)
        x, y = np.moveaxis(offset_w, -1, 0)
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


class OpenLoop(_FixedPolicy):
    """Answer a command of speed and yaw rate with the drive that brings it about on flat ground.

    With commanded speed v and yaw rate w, the left drive is `v / speed - w / yaw_rate`, and the
    right one `v / speed + w / yaw_rate`.

    Parameters
    ----------
    command
        Where in the flat observation the command stands: speed in 20 mm/s, yaw rate in 10 rad/s.
    drive_to_action
        Mapping of the task.
    speed
        mm/s that a drive of 1 on both sides brings about.
    yaw_rate
        rad/s that a drive of 1 more on the right and 1 less on the left would bring about.
    """

    def __init__(
        self,
        command: slice,
        drive_to_action: DriveToAction,
        *,
        speed: float = 13.0,
        yaw_rate: float = 6.4,
    ) -> None:
        super().__init__(drive_to_action)
        self._command = command
        self._speed = speed
        self._yaw_rate = yaw_rate

    def _drive(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        command = observation[..., self._command]
        forward = 20.0 * command[..., :1] / self._speed
        turn = 10.0 * command[..., 1:] / self._yaw_rate * np.array([-1.0, 1.0])
        return np.asarray(forward + turn)


FixedPolicy = ConstantDrive | Pursuit | OpenLoop | WormCPG | WormReflex | Relaxed


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


_QUICK_PURSUIT: Final = {"gain": 2.0, "forward": 1.5, "weakest": 0.0, "strongest": 1.5}
"""The quickest to a target of 16 settings (flat ground, 64 to 128 episodes that no evaluation has)
without a fall, at 0.81 s instead of 1.00; on a path the literature's turn keeps closer to it."""

_GOALS: Final = (ACHIEVED_GOAL, DESIRED_GOAL, "compass")


def _walk(task: Task) -> FixedPolicy:
    return ConstantDrive(1.0, 1.0, task.actions.of)


def _stand(task: Task) -> FixedPolicy:
    return ConstantDrive(0.0, 0.0, task.actions.of)


def _pursue(task: Task) -> FixedPolicy:
    tuned = _QUICK_PURSUIT if task.name in ("target", "target_goal", "heading") else {}
    shown = task.slices()
    if "target_direction" in shown:
        return Pursuit(shown["target_direction"], task.actions.of, **tuned)
    achieved, desired, compass = (shown[name] for name in _GOALS)
    return PursuitOfGoal(achieved, desired, compass, task.actions.of, **tuned)


def _wave(task: Task) -> FixedPolicy:
    actions, interval_s = _muscles(task)
    return WormCPG(actions, interval_s)


def _bend(task: Task) -> FixedPolicy:
    actions, interval_s = _muscles(task)
    return WormReflex(actions, interval_s, task.slices()["bend_error"])


def _relax(task: Task) -> FixedPolicy:
    actions, _ = _muscles(task)
    return Relaxed(actions)


def _muscles(task: Task) -> tuple[Neurons, float]:
    """Actions of a task for worms, and s from one to the next."""
    actions, interval_s = task.actions, task.decision_interval_s
    assert isinstance(actions, Neurons) and interval_s is not None  # goes_with says so
    return actions, interval_s


def _follow_command(task: Task) -> FixedPolicy:
    return OpenLoop(task.slices()["command"], task.actions.of)


_AHEAD: Final = "constant drive (1, 1)"

FIXED: Final[Mapping[str, FixedLaw]] = {
    "cpg": FixedLaw("cpg", _AHEAD, _walk),
    "rule_based": FixedLaw("rule_based", _AHEAD, _walk),
    "hybrid": FixedLaw("hybrid", _AHEAD, _walk),
    "hybrid_current": FixedLaw(
        "hybrid", f"{_AHEAD}, current reflexes", _walk, reflexes="current", is_usual=False
    ),
    "hybrid_classic": FixedLaw(
        "hybrid", f"{_AHEAD}, classic reflexes", _walk, reflexes="classic", is_usual=False
    ),
    "pursuit": FixedLaw(
        "hybrid",
        "proportional steering towards the target",
        _pursue,
        (("target_direction",), _GOALS),
    ),
    "open_loop": FixedLaw(
        "hybrid", "drive that answers the command", _follow_command, (("command",),)
    ),
    "zero": FixedLaw("hybrid", "constant drive (0, 0)", _stand),
    "worm_cpg": FixedLaw(None, "CPG that sends waves along the worm", _wave, (("heading",),)),
    "worm_reflex": FixedLaw(
        None, "reflex that recruits until the bend is right", _bend, (("bend_error",),)
    ),
    "relaxed": FixedLaw(None, "no muscle recruited", _relax),
}
"""Fixed laws by name. Besides, there is constant(left, right): any drive, held."""

_CONSTANT: Final = re.compile(r"constant\(\s*([^,\s]+)\s*,\s*([^,\s]+)\s*\)")


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
        return FixedLaw(name, _AHEAD, _walk)
    return FIXED[name] if name in FIXED else _constant(name)


def fixed_policy(name: str, law: FixedLaw, task: Task | None = None) -> FixedPolicy:
    """Policy that follows a law in a task; None takes the first task that the law goes with.

    Raises
    ------
    ValueError
        The task does not show what the law needs.
    """
    if task is None:
        task = next(each for each in map(task_named, TASK_NAMES) if law.goes_with(each))
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
    return FixedLaw(
        "hybrid",
        f"constant drive ({left:g}, {right:g})",
        lambda task: ConstantDrive(left, right, task.actions.of),
    )
