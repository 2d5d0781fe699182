"""Policies that were not learned: a constant drive, a steering law, an inverse map of drives."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.policies.vectors import vectors

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
