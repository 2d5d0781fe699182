"""Interface of what is played, and its course in time while somebody watches."""

import copy
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

import mujoco

from flyrl.play.recording import FRAMES_PER_S, VideoRecorder
from flyrl.validation import random_seed

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting

MAX_LAG_S: Final = 0.1
"""Longest simulated time that is made up for, where the computer does not keep up."""

BUDGET_S: Final = 0.05
"""Longest time that the simulation may take at once, so that the page stays responsive; the rest is
dropped."""

SPEEDS: Final[Mapping[str, float]] = {
    "1/16": 1 / 16, "1/8": 1 / 8, "1/4": 1 / 4, "1/2": 1 / 2, "1": 1.0, "2": 2.0
}  # fmt: skip
"""Simulated time per real time, by name."""

PAUSE, STEP, RESET = "space", "enter", "backspace"
SPEED, SEED, RECORD = "session.speed", "session.seed", "session.record"
"""Names of the session's own controls: keys, and others."""

_KEYS: Final = {PAUSE: "pause, resume", STEP: "pause, a single step", RESET: "reset"}

_RATE_S: Final = 0.5
"""Time over which the speed that is reached is measured."""


class Playable(Protocol):
    """A simulation that a person acts on while it runs; a subclass says what it is.

    Attributes
    ----------
    title
        Its name.
    keys
        Name of a key -> what a press does, in a few words. Letters, and "up", "down", "left",
        "right"; "click" is a click on the ground.
    interval_s
        Simulated time that a step takes, s.
    seed
        Of the last reset.
    model, data
        Of MuJoCo, to be drawn. The model is another object after the scene was changed.
    camera
        From where it is seen at first.
    """

    title: str
    keys: Mapping[str, str]
    interval_s: float
    seed: int = 0
    model: mujoco.MjModel
    data: mujoco.MjData
    camera: mujoco.MjvCamera

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset, s."""
        return float(self.data.time)

    @property
    def hint(self) -> str:
        """A line that stands in the picture: the keys that matter at the moment."""

    def step(self) -> None:
        """Simulate a step."""

    def reset(self, seed: int) -> None:
        """Start again; the same seed starts the same. ValueError if it is no seed."""

    def change(self, name: str, value: "Setting") -> None:
        """Set a control of the panel, press a key (True), or "click" on the ground (x, y, mm).

        Raises
        ------
        ValueError
            If the value is not allowed; everything is as before then.
        """

    def relax(self) -> None:
        """Let go of all that a person holds, since nobody is there any more."""

    def draw(self, panel: "Panel") -> None:
        """Draw the panel's sections as they are at the moment."""

    def figures(self) -> Mapping[str, float | str | bool]:
        """Values for the log, rounded to what is worth a line."""


class Session:
    """Plays something: steps it, hands on what a person does, and logs what changes.

    Parameters
    ----------
    playable
        What is played.
    recorder
        Makes videos of it.
    log
        Called with an entry at the start, and whenever it differs in anything but time from the one
        before: `time_s`, which has passed in the simulation; `is_watched`, `is_paused`, `speed`,
        `seed`, `is_recording`; `recording`, what the recorder says; `message`, why the latest
        change was refused; and `playable.figures()`.
    clock
        Tells time in s, to see how long the simulation takes.

    Attributes
    ----------
    is_watched, is_paused
        Whether somebody is there; whether time stands still all the same.
    speed
        One of `SPEEDS`.
    keys
        Name of a key -> what a press does: the playable's, and those of the session.
    camera
        From where it is seen.
    """

    def __init__(
        self,
        playable: Playable,
        recorder: VideoRecorder,
        log: Callable[[Mapping[str, Any]], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.playable: Final = playable
        self.keys: Final = {**playable.keys, **_KEYS}
        self.camera = copy.copy(playable.camera)
        self.is_watched = self.is_paused = False
        self.speed = "1"
        self._recorder = recorder
        self._log = log
        self._clock = clock
        self._last_s: float | None = None
        self._owed_s = self._owed_frames = 0.0
        self._rate, self._rate_since = "", (0.0, 0.0)
        self._next_seed = playable.seed
        self._message = ""
        self._logged: dict[str, Any] | None = None
        self._note()

    def watch(self, is_watched: bool) -> None:
        """Resume, since somebody watches; or else relax and wait."""
        self.is_watched = is_watched
        if not is_watched:
            self.playable.relax()
            self._recorder.stop()
        self._note()

    def change(self, name: str, value: "Setting") -> None:
        """Set a control or press a key; a refusal is shown on the panel and logged.

        While nobody watches this does nothing.
        """
        if not self.is_watched:
            return
        try:
            self._change(name, value)
            self._message = ""
        except ValueError as error:
            self._message = " ".join(str(error).split())
        self._note()

    def advance(self, now_s: float) -> None:
        """Step the physics up to a time in s, of any clock that only goes forward."""
        if not self.is_watched or self.is_paused:
            self._last_s, self._rate = None, ""
        else:
            if self._last_s is None:
                self._last_s, self._owed_s = now_s, 0.0
                self._rate_since = now_s, self.playable.time_s
            interval_s = self.playable.interval_s
            owed_s = self._owed_s + (now_s - self._last_s) * SPEEDS[self.speed]
            self._owed_s = min(owed_s, max(MAX_LAG_S, interval_s))
            self._last_s = now_s
            end_s = self._clock() + BUDGET_S
            # a hair more: 0.1 / 0.001 must not come to 99
            for _ in range(int(self._owed_s / interval_s + 1e-6)):
                self._owed_s -= interval_s
                if self._clock() <= end_s:
                    self._step()
            self._measure(now_s)
        self._note()

    def draw(self, panel: "Panel") -> None:
        """Draw the session's own controls, then those of what is played."""
        if panel.section("Time"):
            rate = "paused" if self.is_paused else self._rate
            panel.text(f"{self.playable.time_s:.2f} s   {rate}")
            pause = "Resume" if self.is_paused else "Pause"
            panel.buttons({PAUSE: pause, STEP: "Step", RESET: "Reset"})
            panel.choice(SPEED, "speed", tuple(SPEEDS), self.speed)
            panel.integer(SEED, "seed of a reset", self._next_seed)
            panel.switch(RECORD, "record a video", self._recorder.is_on)
            for note in filter(None, (self._recorder.note, self._message)):
                panel.text(note)
        self.playable.draw(panel)

    def _change(self, name: str, value: "Setting") -> None:
        if name == PAUSE:
            self.is_paused = not self.is_paused
        elif name == STEP:
            self.is_paused = True
            self._step()
        elif name == RESET:
            self.playable.reset(self._next_seed)
            self._last_s = None
        elif name == SPEED:
            self.speed = str(value)
        elif name == SEED:
            self._next_seed = random_seed(cast(int, value))
        elif name == RECORD:
            self._owed_frames = 1.0
            (self._recorder.start if value else self._recorder.stop)()
        else:
            self.playable.change(name, value)

    def _step(self) -> None:
        """Take a step; a video shows it for as long as it takes on the screen."""
        playable = self.playable
        playable.step()
        if self._recorder.is_on:
            self._owed_frames += FRAMES_PER_S * playable.interval_s / SPEEDS[self.speed]
            number = int(self._owed_frames + 1e-6)
            self._owed_frames -= number
            self._recorder.take(playable.model, playable.data, self.camera, number)

    def _measure(self, now_s: float) -> None:
        """Measure how fast simulated time passes."""
        then_s, before_s = self._rate_since
        if now_s - then_s >= _RATE_S:
            self._rate = f"{(self.playable.time_s - before_s) / (now_s - then_s):.2f} x real time"
            self._rate_since = now_s, self.playable.time_s

    def _note(self) -> None:
        """Log what has changed."""
        entry = {
            "is_watched": self.is_watched,
            "is_paused": self.is_paused,
            "speed": SPEEDS[self.speed],
            "seed": self.playable.seed,
            "is_recording": self._recorder.is_on,
            "recording": self._recorder.note,
            "message": self._message,
            **self.playable.figures(),
        }
        if entry != self._logged:
            self._logged = entry
            self._log({"time_s": round(self.playable.time_s, 4), **entry})
