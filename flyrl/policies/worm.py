"""Fixed policies for worms: a CPG that sends waves along the body, a reflex, and rest."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.controllers.cpg import cpg_step, motor_neuron_activity
from flyrl.policies.networks import vectors
from flyrl.tasks import Neurons

Array = NDArray[np.float64]

_STEP_S: Final = 1e-3
"""s; at most as long does an oscillator advance at a time."""

COUPLING_WEIGHT: Final = 10.0
CONVERGENCE_RATE: Final = 20.0
"""Of the oscillators, 1/s, as in the fly's CPG."""


class Relaxed:
    """No muscle is recruited beyond its first neuron.

    Parameters
    ----------
    actions
        Of the task.
    """

    def __init__(self, actions: Neurons) -> None:
        self._actions = actions

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Action (M,) for an observation (k,), or (n, M) for (n, k); and `state`."""
        rows = vectors(observation).shape[:-1]
        return _actions_of(self._actions, np.zeros((*rows, self._actions.size))), state


class WormCPG:
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
        self._frequencies = np.full(joints, frequency_hz)
        self._amplitudes = np.full(joints, amplitude)
        self._rates = np.full(joints, CONVERGENCE_RATE)
        self._phases = -2.0 * np.pi * waves * np.arange(joints) / joints
        self._biases = self._phases[None, :] - self._phases[:, None]
        near = np.abs(np.subtract.outer(np.arange(joints), np.arange(joints))) == 1
        self._weights = np.where(near, COUPLING_WEIGHT, 0.0)
        self._last = np.array(actions.pools) - 1.0

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: tuple[Array, Array] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Array, Array]]:
        """Action (M,) for an observation (k,), or (n, M) for (n, k); and the oscillators' state.

        That is phases and magnitudes, (n, joints) each; None, or an episode's start, begins anew.
        """
        values = vectors(observation)
        num_rows = len(np.atleast_2d(values))
        phases = np.tile(self._phases, (num_rows, 1))
        magnitudes = np.zeros_like(phases)
        if state is not None:
            goes_on = ~_starts(episode_start, num_rows)
            phases[goes_on], magnitudes[goes_on] = state[0][goes_on], state[1][goes_on]
        for row in range(num_rows):
            self._advance(phases[row], magnitudes[row])
        activity = np.stack(
            [
                motor_neuron_activity(magnitudes, phases),
                motor_neuron_activity(magnitudes, phases + np.pi),
            ],
            axis=-1,
        ).reshape(num_rows, -1)
        actions = _actions_of(self._actions, activity * self._last)
        return (actions if values.ndim == 2 else actions[0]), (phases, magnitudes)

    def _advance(self, phases: Array, magnitudes: Array) -> None:
        """Advance one worm's oscillators by a decision, in place."""
        room = np.empty_like(phases)
        for _ in range(self._steps):
            cpg_step(
                phases,
                magnitudes,
                self._frequencies,
                self._amplitudes,
                self._weights,
                self._biases,
                self._rates,
                self._timestep,
                room,
            )


class WormReflex:
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

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Array]:
        """Action (M,) for an observation (k,), or (n, M) for (n, k); and the shares, (n,)."""
        values = vectors(observation)
        rows = np.atleast_2d(values)
        share = np.zeros(len(rows))
        if state is not None:
            share = np.where(_starts(episode_start, len(rows)), 0.0, state)
        share = np.clip(share - self._rate * rows[:, self._bend_error][:, 0], -1.0, 1.0)
        sides = np.stack([np.maximum(share, 0.0), np.maximum(-share, 0.0)], axis=1)
        both = np.tile(sides, (1, self._actions.size // 2))
        actions = _actions_of(self._actions, both * self._last)
        return (actions if values.ndim == 2 else actions[0]), share


def _starts(episode_start: ArrayLike | None, num_rows: int) -> NDArray[np.bool_]:
    if episode_start is None:
        return np.zeros(num_rows, dtype=bool)
    return np.broadcast_to(np.asarray(episode_start, dtype=bool), (num_rows,))


def _actions_of(actions: Neurons, neurons: Array) -> NDArray[Any]:
    """Actions that recruit these numbers of neurons, rounded, within the pools."""
    wanted = np.clip(np.round(neurons), 0.0, np.array(actions.pools) - 1.0)
    return actions.of(wanted).astype(np.int64 if actions.is_integer else np.float32)
