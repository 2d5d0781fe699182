"""Action spaces of tasks, and the commands that actions stand for."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from flyrl.controllers.controller import (
    DRIVE,
    DRIVE_HIGH,
    DRIVE_LOW,
    JOINTS_COMMAND,
    NUM_JOINTS,
    NUM_LEGS,
    Command,
)
from flyrl.validation import FloatArray, float_array, known_keys

__all__ = ["DRIVE_HIGH", "DRIVE_LOW", "Actions", "Drives", "JointTargets", "Neurons"]


@dataclass(frozen=True)
class Drives:
    """The command of a leg controller, mostly the descending drive to the left and right legs.

    Attributes
    ----------
    low, high
        Range of an action's components, mapped linearly to that of the command's; None: an action
        is the command itself.
    command
        The controller's command: names and bounds.
    """

    low: float | None = -1.0
    high: float | None = 1.0
    command: Command = DRIVE

    is_integer = False
    creature = "fly"

    @property
    def size(self) -> int:
        """Components of an action."""
        return len(self.command.names)

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest value of an action's components, (k,) each."""
        if self.low is None or self.high is None:
            return self._command_range
        return np.full(self.size, self.low), np.full(self.size, self.high)

    @property
    def space(self) -> spaces.Space[Any]:
        """Gymnasium's space of an action."""
        return _box(*self.bounds)

    def commands(self, actions: ArrayLike) -> FloatArray:
        """Map actions (..., k), clipped to their range, to commands (..., k)."""
        low, high = self.bounds
        # np.clip takes twice as long
        clipped = np.minimum(np.maximum(np.asarray(actions, dtype=np.float64), low), high)
        return clipped if self.low is None else _mapped(clipped, (low, high), self._command_range)

    def of(self, commands: ArrayLike) -> FloatArray:
        """Map commands to the actions that give them; the inverse of `commands`."""
        given = np.asarray(commands, dtype=np.float64)
        return given if self.low is None else _mapped(given, self._command_range, self.bounds)

    def of_command(self, command: Command) -> "Drives":
        """Actions that command something else: scaled if these are, else the command itself."""
        is_scaled = (self.low, self.high) == (-1.0, 1.0)
        return Drives(command=command) if is_scaled else Drives(None, None, command)

    @cached_property
    def _command_range(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.command.low, np.float64), np.array(self.command.high, np.float64)


@dataclass(frozen=True)
class JointTargets(Drives):
    """Target angles of the 42 joints, rad, and adhesion of the six legs.

    Attributes
    ----------
    is_dict
        Whether an environment takes a dict of "joints" (42,) and "adhesion" (6,), 0 or 1; otherwise
        it takes both in one vector, with adhesion from 0 to 1.
    """

    low: float | None = None
    high: float | None = None
    command: Command = JOINTS_COMMAND
    is_dict: bool = True

    @property
    def space(self) -> spaces.Space[Any]:
        """Gymnasium's space of an action."""
        low, high = self.bounds
        if not self.is_dict:
            return _box(low, high)
        joints = _box(low[:NUM_JOINTS], high[:NUM_JOINTS])
        return spaces.Dict({"joints": joints, "adhesion": spaces.MultiBinary(NUM_LEGS)})

    def commands(self, actions: ArrayLike) -> FloatArray:
        """Take actions (..., 48) as they are: no joint has a limit, and reflexes go beyond π."""
        return np.asarray(actions, dtype=np.float64)


@dataclass(frozen=True)
class Neurons:
    """A number per muscle, which says up to which of its motor neurons it is recruited.

    Attributes
    ----------
    pools
        Number of motor neurons of each muscle, (M,).
    is_integer
        Whether an action is whole numbers: the indices of the neurons, from 0. Otherwise its
        components go from `low` to `high`, which are mapped linearly to the first and to the last
        neuron, and rounded.
    """

    pools: tuple[int, ...]
    is_integer: bool = True

    low = -1.0
    high = 1.0
    creature = "worm"

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest value of an action's components, (M,) each."""
        return np.full(self.size, self.low), np.full(self.size, self.high)

    @property
    def space(self) -> spaces.Space[Any]:
        """Gymnasium's space of an action."""
        return spaces.MultiDiscrete(list(self.pools)) if self.is_integer else _box(*self.bounds)

    def __post_init__(self) -> None:
        if not self.pools or min(self.pools) < 1:
            raise ValueError(f"pools must be numbers of neurons above 0, got {self.pools}")

    @property
    def size(self) -> int:
        """Components of an action."""
        return len(self.pools)

    def commands(self, actions: ArrayLike) -> FloatArray:
        """Map actions (..., M) to the whole numbers of neurons, (..., M), within the pools.

        Raises
        ------
        ValueError
            If whole numbers are asked for, and one is none, or no neuron of its pool.
        """
        given = np.asarray(actions, dtype=np.float64)
        last = np.array(self.pools) - 1.0
        if self.is_integer:
            if ((given != np.round(given)) | (given < 0.0) | (given > last)).any():
                raise ValueError(
                    f"action must be whole numbers from 0 to {last.astype(int).tolist()}, got "
                    f"{given.tolist()}"
                )
            return given
        clipped = np.clip(given, self.low, self.high)
        return np.round(_mapped(clipped, self.bounds, (0.0, last)))

    def of(self, neurons: ArrayLike) -> FloatArray:
        """Map numbers of neurons to the actions that command them; the inverse of `commands`."""
        given = np.asarray(neurons, dtype=np.float64)
        if self.is_integer:
            return given
        last = np.maximum(np.array(self.pools) - 1.0, 1.0)
        return _mapped(given, (0.0, last), self.bounds)


def action_vectors(actions: Any) -> FloatArray:
    """Actions as an action space has them, as vectors, (…, size).

    Raises
    ------
    ValueError
        If a dict lacks a key or holds another one, or what is there is not allowed.
    """
    if not isinstance(actions, Mapping):
        return np.asarray(actions, dtype=np.float64)
    known_keys("action", actions, ("joints", "adhesion"))
    if len(actions) < 2:
        raise ValueError(f"action must have 'joints' and 'adhesion', got {', '.join(actions)}")
    shape = np.shape(actions["joints"])[:-1]
    joints = float_array("action['joints']", actions["joints"], (*shape, NUM_JOINTS))
    grips = float_array(
        "action['adhesion']", actions["adhesion"], (*shape, NUM_LEGS), minimum=0.0, maximum=1.0
    )
    return np.concatenate([joints, grips], axis=-1)


def _mapped(values: FloatArray, source: tuple[Any, Any], target: tuple[Any, Any]) -> FloatArray:
    """Values of one range, (low, high), mapped linearly to another."""
    (low, high), (least, greatest) = source, target
    mapped: FloatArray = least + (values - low) / (high - low) * (greatest - least)
    return mapped


def _box(low: FloatArray, high: FloatArray) -> spaces.Box:
    return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


Actions = Drives | Neurons
