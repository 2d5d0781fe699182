"""Policies that were not learned: drives, steering laws, functions, and worms' rhythms."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.controllers.cpg import cpg_step, motor_neuron_activity
from flyrl.policies.networks import vectors
from flyrl.tasks import Drives, Neurons, Task
from flyrl.validation import FloatArray

DriveToAction = Callable[[FloatArray], FloatArray]
"""From drives (..., 2), left then right, to the actions (..., 2) that command them."""

Starts = NDArray[np.bool_]
Acted = tuple[NDArray[Any], Any]
"""Actions and state."""

Law = Callable[[float, Mapping[str, FloatArray]], Any]
"""From the time, s, and what one fly observes, by the names of the terms, to its drive."""

_STEP_S: Final = 1e-3
"""s; at most as long does an oscillator advance at a time."""

COUPLING_WEIGHT: Final = 10.0
CONVERGENCE_RATE: Final = 20.0
"""Of the oscillators, 1/s, as in the fly's CPG."""


class FixedPolicy:
    """A policy that was not learned."""

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> Acted:
        """Action for one observation or a batch, with the signature of Stable-Baselines3.

        Parameters
        ----------
        observation
            Shape (k,) or (n, k); or a dict, as of a task with goals, that `vectors` makes one of.
        state
            What the call before returned; None at first.
        episode_start
            Whether an episode starts with this observation, (n,); None means nowhere.
        deterministic
            Without effect.

        Returns
        -------
        Action, (a,) or (n, a), and the state of the policy.
        """
        values = vectors(observation)
        rows = np.atleast_2d(values)
        starts = np.zeros(len(rows), dtype=bool)
        if episode_start is not None:
            starts |= np.asarray(episode_start, dtype=bool)
        actions, state = self._act(rows, state, starts)
        return (actions if values.ndim > 1 else actions[0]), state

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """Actions (n, a) for observations (n, k), and the state after them."""
        raise NotImplementedError


class _DrivePolicy(FixedPolicy):
    """A policy without a state that answers an observation with a drive."""

    def __init__(self, drive_to_action: DriveToAction) -> None:
        self._drive_to_action = drive_to_action

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        return np.array(self._drive_to_action(self._drive(rows)), dtype=np.float32), state

    def _drive(self, observation: FloatArray) -> FloatArray:
        """Drives (..., 2) for observations (..., k)."""
        raise NotImplementedError


class ConstantDrive(_DrivePolicy):
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

    def _drive(self, observation: FloatArray) -> FloatArray:
        return np.broadcast_to(self._sides, (*observation.shape[:-1], 2))


class Pursuit(_DrivePolicy):
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

    def _drive(self, observation: FloatArray) -> FloatArray:
        direction = self._towards(observation)
        bearing = np.arctan2(direction[..., 1], direction[..., 0])
        turn = self._gain * bearing[..., None] * np.array([-1.0, 1.0])
        return np.asarray(np.clip(self._forward + turn, *self._bounds))

    def _towards(self, observation: FloatArray) -> FloatArray:
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

    def _towards(self, observation: FloatArray) -> FloatArray:
        offset_w = observation[..., self._direction] - observation[..., self._achieved]
        cos, sin = np.moveaxis(observation[..., self._compass], -1, 0)
        x, y = np.moveaxis(offset_w, -1, 0)
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


class OpenLoop(_DrivePolicy):
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

    def _drive(self, observation: FloatArray) -> FloatArray:
        command = observation[..., self._command]
        forward = 20.0 * command[..., :1] / self._speed
        turn = 10.0 * command[..., 1:] / self._yaw_rate * np.array([-1.0, 1.0])
        return np.asarray(forward + turn)


class FunctionPolicy(FixedPolicy):
    """A function `(time_s, observation) -> drive` as a policy; it is called for one fly at a time.

    Parameters
    ----------
    law
        Takes the time since the start of the episode, s, and a dict of arrays: the task's
        observation by the names of its terms. Returns what the leg controller takes: for most the
        drive (left, right); of a worm, an action of the task.
    task
        What it acts in.
    """

    def __init__(self, law: Law, task: Task) -> None:
        self._law = law
        self._task = task
        places = task.slices()
        self._places = [(term.name, places[term.name], term.shape) for term in task.observation]

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """The state is the number of decisions since the start of each episode, (n,)."""
        decisions = np.where(starts, 0, 0 if state is None else state)
        times_s = decisions * (self._task.decision_interval_s or 0.0)
        actions = [
            self._action(time_s, row) for time_s, row in zip(times_s.tolist(), rows, strict=True)
        ]
        return np.stack(actions), decisions + 1

    def _action(self, time_s: float, row: FloatArray) -> NDArray[Any]:
        shown = {name: row[place].reshape(shape) for name, place, shape in self._places}
        given = np.asarray(self._law(time_s, shown), dtype=np.float64)
        actions = self._task.actions
        if given.shape != (actions.size,):
            raise ValueError(
                f"a steering law must return {actions.size} numbers, got shape {given.shape}"
            )
        # as precise as an action that a network gives
        return actions.of(given).astype(np.float32) if isinstance(actions, Drives) else given


def takes(function: Callable[..., Any], count: int) -> bool:
    """Whether a function can be called with so many arguments by position, and no others."""
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        return False
    except ValueError:  # of C's, without a signature
        return count == 1
    return True


class Relaxed(FixedPolicy):
    """No muscle is recruited beyond its first neuron.

    Parameters
    ----------
    actions
        Of the task.
    """

    def __init__(self, actions: Neurons) -> None:
        self._actions = actions

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        return _actions_of(self._actions, np.zeros((len(rows), self._actions.size))), state


class WormCPG(FixedPolicy):
    """A chain of oscillators, one per joint, which recruits a wave that runs from head to tail.

    Each oscillator drives the two muscles of its joint in antiphase, with the motor-neuron activity
    r (1 + sin θ) and r (1 + sin(θ + π)): the share of a pool's neurons that is recruited, at most
    all. Neighbours are coupled (Ijspeert et al. 2007, doi 10.1126/science.1138353); an episode
    begins in phase, with magnitudes of 0.

    Parameters
    ----------
    actions
        Of the task.
    interval_s
        s from one decision to the next.
    frequency_hz
        Waves per second.
    waves
        Of them along the worm, from the first joint to where one more would follow the last.
    amplitude
        That the magnitudes r approach; 0.5 recruits whole pools, more holds them for longer.
    """

    def __init__(
        self,
        actions: Neurons,
        interval_s: float,
        *,
        frequency_hz: float = 3.0,
        waves: float = 0.4,
        amplitude: float = 0.8,
    ) -> None:
        self._actions = actions
        joints = actions.size // 2
        self._steps = max(1, round(interval_s / _STEP_S))
        self._timestep = interval_s / self._steps
        self._phases = -2.0 * np.pi * waves * np.arange(joints) / joints
        near = np.abs(np.subtract.outer(np.arange(joints), np.arange(joints))) == 1
        self._oscillators = (
            np.full(joints, frequency_hz),
            np.full(joints, amplitude),
            np.where(near, COUPLING_WEIGHT, 0.0),
            self._phases[None, :] - self._phases[:, None],
            np.full(joints, CONVERGENCE_RATE),
        )
        self._last = np.array(actions.pools) - 1.0

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """The state is the phases and magnitudes of the oscillators, (n, joints) each."""
        phases = np.tile(self._phases, (len(rows), 1))
        magnitudes = np.zeros_like(phases)
        if state is not None:
            phases[~starts], magnitudes[~starts] = (part[~starts] for part in state)
        phase_rates = np.empty(len(self._phases))
        for own in zip(phases, magnitudes, strict=True):
            for _ in range(self._steps):
                cpg_step(*own, *self._oscillators, self._timestep, phase_rates)
        sides = [motor_neuron_activity(magnitudes, phases + turn) for turn in (0.0, np.pi)]
        activity = np.stack(sides, axis=-1).reshape(len(rows), -1)
        return _actions_of(self._actions, activity * self._last), (phases, magnitudes)


class WormReflex(FixedPolicy):
    """Recruit the muscles of one side more and more, until the worm is bent as commanded.

    The share of neurons that is recruited, of the first muscle of every joint (or, below 0, of the
    second), falls at a rate of `gain` per rad of too much bend and s.

    Parameters
    ----------
    actions
        Of the task.
    interval_s
        s from one decision to the next.
    bend_error
        Where in the observation the bend less the one that is asked for stands, rad.
    gain
        1/(rad s); the best return of seven from 2 to 10.
    """

    def __init__(
        self, actions: Neurons, interval_s: float, bend_error: slice, *, gain: float = 6.0
    ) -> None:
        self._actions = actions
        self._rate = gain * interval_s
        self._bend_error = bend_error
        self._last = np.array(actions.pools) - 1.0

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """The state is the share that is recruited, from -1 to 1, (n,)."""
        share = np.where(starts, 0.0, 0.0 if state is None else state)
        share = np.clip(share - self._rate * rows[:, self._bend_error][:, 0], -1.0, 1.0)
        sides = np.stack([np.maximum(share, 0.0), np.maximum(-share, 0.0)], axis=1)
        both = np.tile(sides, (1, self._actions.size // 2))
        return _actions_of(self._actions, both * self._last), share


def _actions_of(actions: Neurons, neurons: FloatArray) -> NDArray[Any]:
    """Actions that recruit these numbers of neurons, rounded, within the pools."""
    wanted = np.clip(np.round(neurons), 0.0, np.array(actions.pools) - 1.0)
    return actions.of(wanted).astype(np.int64 if actions.is_integer else np.float32)
