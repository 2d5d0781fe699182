"""The course of what is played: in real time while somebody watches, and told to a log."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import mujoco

from flyrl.play.playable import Playable

MAX_LAG_S: Final = 0.1
"""How much time is made up for at most, where the computer does not keep up."""


@dataclass
class Pace:
    """Says how many steps of the physics are due, so that they pass in real time.

    Attributes
    ----------
    timestep_s : of the physics.
    """

    timestep_s: float
    _last_s: float | None = None
    _owed_s: float = 0.0

    def steps(self, now_s: float) -> int:
        """Steps due since the last call; none at the first one, and the first after a `pause`.

        Parameters
        ----------
        now_s : of any clock that only goes forward.
        """
        passed = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self._owed_s = min(self._owed_s + passed, MAX_LAG_S)
        # a hair more, lest 0.1 / 0.001 come to 99
        steps = int(self._owed_s / self.timestep_s + 1e-6)
        self._owed_s -= steps * self.timestep_s
        return steps

    def pause(self) -> None:
        """Let time pass without steps until the next call of `steps`."""
        self._last_s = None
        self._owed_s = 0.0


class Session:
    """Plays something: steps it, presses keys, and logs what changes.

    Parameters
    ----------
    playable
        What is played.
    log
        Called with an entry at the start, and whenever it differs in anything but time from the one
        before: `time_s`, which has passed in the simulation; `is_watched`; and
        `playable.figures()`.
    """

    def __init__(
        self, playable: Playable, log: Callable[[Mapping[str, Any]], None] = lambda entry: None
    ) -> None:
        self.playable: Final = playable
        self._log = log
        self._pace = Pace(playable.model.opt.timestep)
        self._told: dict[str, Any] | None = None
        self.is_watched = False
        self._tell()

    def watch(self, is_watched: bool) -> None:
        """Go on, since somebody watches; or else relax and pause."""
        self.is_watched = is_watched
        if not is_watched:
            self.playable.relax()
            self._pace.pause()
        self._tell()

    def press(self, key: str) -> None:
        """Press a key; one that means nothing here, or while nobody watches, does nothing."""
        if self.is_watched and key in self.playable.keys:
            self.playable.press(key)
            self._tell()

    def advance(self, now_s: float) -> None:
        """Step the physics up to a time in s, of any clock that only goes forward."""
        steps = self._pace.steps(now_s) if self.is_watched else 0
        if steps:
            mujoco.mj_step(self.playable.model, self.playable.data, steps)
            self._tell()

    def _tell(self) -> None:
        entry = {"is_watched": self.is_watched, **self.playable.figures()}
        if entry != self._told:
            self._told = entry
            self._log({"time_s": round(self.playable.data.time, 4), **entry})
