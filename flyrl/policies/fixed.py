"""Policies that were not learned: drives, steering laws, functions, and worms' rhythms."""

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.controllers.cpg import cpg_step, motor_neuron_activity
from flyrl.policies.networks import vectors
from flyrl.tasks import ACHIEVED_GOAL, DESIRED_GOAL, WALKING_SPEED, Drives, Neurons, Task
from flyrl.tasks.terms import DISTANCE_UNIT, SPEED_UNIT, YAW_RATE_UNIT
from flyrl.validation import FloatArray

Starts = NDArray[np.bool_]
Acted = tuple[NDArray[Any], Any]
"""Actions and state."""

Law = Callable[[float, Mapping[str, FloatArray]], Any]
"""From the time, s, and what one fly observes, by the names of the terms, to its drive."""

_STEP_S: Final = 1e-3
"""s; at most as long does an oscillator advance at a time."""

YAW_RATE: Final = 6.4
"""rad/s that a drive of 1 more on the right and 1 less on the left would bring about there."""

COUPLING_WEIGHT: Final = 10.0
CONVERGENCE_RATE: Final = 20.0
"""Of the oscillators, 1/s, as in the fly's CPG."""


class FixedPolicy:
    """A policy that was not learned."""

    task: Task
    """What it acts in."""

    @cached_property
    def _term_sizes(self) -> dict[str, int]:
        return {term.name: term.size for term in self.task.observation}

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
        values = vectors(observation, self._term_sizes)
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

    @cached_property
    def _places(self) -> dict[str, slice]:
        return self.task.slices()

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        shown = {name: rows[:, place] for name, place in self._places.items()}
        drives = np.broadcast_to(self._drives(shown), (len(rows), 2))
        return self.task.actions.of(drives).astype(np.float32), state

    def _drives(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        """Drives (n, 2), or (2,) for all, for observation terms (n, size) by name."""
        raise NotImplementedError


@dataclass(eq=False)
class ConstantDrive(_DrivePolicy):
    """The same drive at every decision.

    Parameters
    ----------
    left, right
        Drive to the left and to the right legs; (1, 1) walks, (0, 0) stands.
    task
        What it acts in.
    """

    left: float
    right: float
    task: Task

    def _drives(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        return np.array([self.left, self.right])


@dataclass(eq=False)
class Pursuit(_DrivePolicy):
    """Turn towards the target, the more the further it lies to the side.

    With bearing b (rad, positive to the left), the left drive is `forward - gain * b` and the right
    one `forward + gain * b`, both kept between `weakest` and `strongest`.

    Parameters
    ----------
    task
        What it acts in; it shows `target_direction`, or goals and the `compass`.
    gain
        Drive per rad of bearing.
    forward
        Drive of both sides when the target is straight ahead.
    weakest, strongest
        Bounds of the drive. The default turn, (1.2, 0.2), is that of the literature; stronger
        differences can tip the fly over.
    brake
        Where the fly is to stop at the target: distance, mm, from which on the drive falls, to 0 at
        half of it; the task shows `target_distance`. 0 lets it walk on.
    lead
        Where the target moves: time, s, ahead of it; the fly turns to where the target, going on
        straight, will be by then. The task shows `target_distance` and `target_velocity`.
    """

    task: Task
    _: KW_ONLY
    gain: float = 1.0
    forward: float = 1.0
    weakest: float = 0.2
    strongest: float = 1.2
    brake: float = 0.0
    lead: float = 0.0

    def _drives(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        return self._steered(shown, self.forward, self.strongest)

    def _steered(
        self, shown: Mapping[str, FloatArray], forward: float | FloatArray, strongest: Any
    ) -> FloatArray:
        """Drives (n, 2) with a drive ahead and an upper bound, one each or (n, 1)."""
        ahead, left = self._towards(shown)
        turn = self.gain * np.arctan2(left, ahead)[:, None] * np.array([-1.0, 1.0])
        drives = np.clip(forward + turn, self.weakest, strongest)
        if self.brake > 0.0:
            in_brakes = DISTANCE_UNIT * shown["target_distance"] / self.brake
            drives = drives * np.clip(2.0 * in_brakes - 1.0, 0.0, 1.0)
        return np.asarray(drives)

    def _towards(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        """Vectors towards the target in the body frame, forward and left: (2, n)."""
        if self.lead > 0.0:
            offset_mm = DISTANCE_UNIT * shown["target_distance"] * shown["target_direction"]
            return np.asarray(offset_mm + SPEED_UNIT * self.lead * shown["target_velocity"]).T
        if "target_direction" in shown:
            return shown["target_direction"].T
        x, y = (shown[DESIRED_GOAL] - shown[ACHIEVED_GOAL]).T  # world frame
        cos, sin = shown["compass"].T
        return np.stack([cos * x + sin * y, cos * y - sin * x])


@dataclass(eq=False)
class OpenLoop(_DrivePolicy):
    """Answer a command of speed and yaw rate with the drive that brings it about on flat ground.

    With commanded speed v and yaw rate w, the left drive is `v / speed - w / yaw_rate`, and the
    right one `v / speed + w / yaw_rate`.

    Parameters
    ----------
    task
        What it acts in; it shows the `command`: speed in 20 mm/s, yaw rate in 10 rad/s.
    speed
        mm/s that a drive of 1 on both sides brings about.
    yaw_rate
        rad/s that a drive of 1 more on the right and 1 less on the left would bring about.
    """

    task: Task
    _: KW_ONLY
    speed: float = WALKING_SPEED
    yaw_rate: float = YAW_RATE

    def _drives(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        asked = self._asked(shown)
        forward = SPEED_UNIT * asked[:, :1] / self.speed
        turn = YAW_RATE_UNIT * asked[:, 1:] / self.yaw_rate * np.array([-1.0, 1.0])
        return np.asarray(forward + turn)

    def _asked(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        """Speed and yaw rate to bring about, in the command's units, (n, 2)."""
        return shown["command"]


@dataclass(eq=False)
class ClosedLoop(OpenLoop):
    """Answer a command as `OpenLoop` does, and correct by the velocity that is felt.

    To speed and yaw rate that are commanded it adds, times a gain, what they lack.

    Parameters
    ----------
    task
        What it acts in; it shows the `command`, and the `mean_velocity` in the same units.
    speed_gain, yaw_gain
        Of the correction.
    speed, yaw_rate
        As of `OpenLoop`.
    """

    _: KW_ONLY
    speed_gain: float = 1.0
    yaw_gain: float = 1.0

    def _asked(self, shown: Mapping[str, FloatArray]) -> FloatArray:
        command = shown["command"]
        gains = np.array([self.speed_gain, self.yaw_gain])
        return np.asarray(command + gains * (command - shown["mean_velocity"]))


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
        self.task = task
        places = task.slices()
        self._places = [(term.name, places[term.name], term.shape) for term in task.observation]

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """The state is the number of decisions since the start of each episode, (n,)."""
        decisions = np.where(starts, 0, 0 if state is None else state)
        times_s = decisions * (self.task.decision_interval_s or 0.0)
        actions = [
            self._action(time_s, row) for time_s, row in zip(times_s.tolist(), rows, strict=True)
        ]
        return np.stack(actions), decisions + 1

    def _action(self, time_s: float, row: FloatArray) -> NDArray[Any]:
        shown = {name: row[place].reshape(shape) for name, place, shape in self._places}
        given = np.asarray(self._law(time_s, shown), dtype=np.float64)
        actions = self.task.actions
        if given.shape != (actions.size,):
            raise ValueError(
                f"a steering law must return {actions.size} numbers, got shape {given.shape}"
            )
        # as precise as an action that a network gives
        return actions.of(given).astype(np.float32) if isinstance(actions, Drives) else given


class _MusclePolicy(FixedPolicy):
    """A policy that recruits neurons of a worm's muscles.

    Parameters
    ----------
    task
        What it acts in.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        actions, interval_s = task.actions, task.decision_interval_s
        assert isinstance(actions, Neurons)  # tasks for worms have such
        assert interval_s is not None
        self._actions, self._interval_s = actions, interval_s
        self._last = np.array(actions.pools) - 1.0

    def _recruiting(self, neurons: FloatArray) -> NDArray[Any]:
        """Actions that recruit these numbers of neurons, rounded, within the pools."""
        wanted = np.clip(np.round(neurons), 0.0, self._last)
        kind = np.int64 if self._actions.is_integer else np.float32
        return self._actions.of(wanted).astype(kind)


class Relaxed(_MusclePolicy):
    """No muscle is recruited beyond its first neuron."""

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        return self._recruiting(np.zeros((len(rows), self._actions.size))), state


class WormCPG(_MusclePolicy):
    """A chain of oscillators, one per joint, which recruits a wave that runs from head to tail.

    Each oscillator drives the two muscles of its joint in antiphase, with the motor-neuron activity
    r (1 + sin θ) and r (1 + sin(θ + π)): the share of a pool's neurons that is recruited, at most
    all. Neighbours are coupled (Ijspeert et al. 2007, doi 10.1126/science.1138353); an episode
    begins in phase, with magnitudes of 0.

    Parameters
    ----------
    task
        What it acts in.
    frequency_hz
        Waves per second.
    waves
        Of them along the worm, from the first joint to where one more would follow the last.
    amplitude
        That the magnitudes r approach; 0.5 recruits whole pools, more holds them for longer.
    """

    def __init__(
        self,
        task: Task,
        *,
        frequency_hz: float = 3.0,
        waves: float = 0.4,
        amplitude: float = 0.8,
    ) -> None:
        super().__init__(task)
        joints = self._actions.size // 2
        self._steps = max(1, round(self._interval_s / _STEP_S))
        self._timestep = self._interval_s / self._steps
        self._phases = -2.0 * np.pi * waves * np.arange(joints) / joints
        near = np.abs(np.subtract.outer(np.arange(joints), np.arange(joints))) == 1
        self._oscillators = (
            np.full(joints, frequency_hz),
            np.full(joints, amplitude),
            np.where(near, COUPLING_WEIGHT, 0.0),
            self._phases[None, :] - self._phases[:, None],
            np.full(joints, CONVERGENCE_RATE),
        )

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
        return self._recruiting(activity * self._last), (phases, magnitudes)


class WormReflex(_MusclePolicy):
    """Recruit the muscles of one side more and more, until the worm is bent as commanded.

    The share of neurons that is recruited, of the first muscle of every joint (or, below 0, of the
    second), falls at a rate of `gain` per rad of too much bend and s.

    Parameters
    ----------
    task
        What it acts in; it shows the `bend_error`, the bend less the one that is asked for, rad.
    gain
        1/(rad s); the best return of seven from 2 to 10.
    """

    def __init__(self, task: Task, *, gain: float = 6.0) -> None:
        super().__init__(task)
        self._rate = gain * self._interval_s
        self._bend_error = task.slices()["bend_error"]

    def _act(self, rows: FloatArray, state: Any, starts: Starts) -> Acted:
        """The state is the share that is recruited, from -1 to 1, (n,)."""
        share = np.where(starts, 0.0, 0.0 if state is None else state)
        share = np.clip(share - self._rate * rows[:, self._bend_error][:, 0], -1.0, 1.0)
        sides = np.stack([np.maximum(share, 0.0), np.maximum(-share, 0.0)], axis=1)
        both = np.tile(sides, (1, self._actions.size // 2))
        return self._recruiting(both * self._last), share
