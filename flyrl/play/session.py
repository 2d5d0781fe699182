"""Session of play: steps in real time or slower while somebody watches, and writes a log."""

import copy
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

import mujoco

from flyrl.play.playable import Playable
from flyrl.validation import one_of, random_seed

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting

FRAMES_PER_S: Final = 25
"""Pictures of a video per second of the screen's time."""

MAX_LAG_S: Final = 0.1
"""How much simulated time is made up for at most, where the computer does not keep up."""

BUDGET_S: Final = 0.05
"""How long the simulation may take at a time, so that the page stays alive; the rest is dropped."""

SPEEDS: Final[Mapping[str, float]] = {
    **{f"1/{part}": 1 / part for part in (16, 8, 4, 2)},
    "1": 1.0,
    "2": 2.0,
}
"""Simulated time per real time, by name."""

PAUSE, STEP, RESET, SPEED, SEED, RECORD = (
    f"session.{name}" for name in ("pause", "step", "reset", "speed", "seed", "record")
)
"""Names of the session's own controls."""

_KEYS: Final = {
    "space": (PAUSE, "pause, go on"),
    "enter": (STEP, "pause, a single step"),
    "backspace": (RESET, "reset"),
}
"""Name of a key -> what it stands for, and in a few words."""

_BITE_S: Final = 0.01
"""Simulated time between two looks at the clock."""

_RATE_S: Final = 0.5
"""Time over which the speed that is reached is measured."""


class Recorder(Protocol):
    """Collector of what is to be seen, which makes a video of it.

    Attributes
    ----------
    is_on
        Whether it collects.
    note
        What a person should know: that a video is being written, where it lies, why there is none;
        empty for nothing.
    """

    is_on: bool
    note: str

    def start(self) -> None:
        """Begin a video."""

    def take(
        self, model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, number: int
    ) -> None:
        """Keep the state as that many pictures, `FRAMES_PER_S` of which pass in a second."""

    def stop(self) -> None:
        """Write the video; this returns before it is there."""

    def close(self) -> None:
        """Write what was collected, and wait until it is there."""


@dataclass
class Pace:
    """Says how many steps of the physics are due, so that they pass in real time, or as is said.

    Attributes
    ----------
    interval_s : simulated time that a step takes.
    max_lag_s : how much simulated time is made up for at most.
    """

    interval_s: float
    max_lag_s: float = MAX_LAG_S
    _last_s: float | None = None
    _owed_s: float = 0.0

    def steps(self, now_s: float, speed: float = 1.0) -> int:
        """Steps due since the last call; none at the first one, and the first after a `pause`.

        Parameters
        ----------
        now_s : of any clock that only goes forward.
        speed : simulated time per time.
        """
        passed = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        longest = max(self.max_lag_s, self.interval_s)
        self._owed_s = min(self._owed_s + passed * speed, longest)
        # a hair more: 0.1 / 0.001 must not come to 99
        steps = int(self._owed_s / self.interval_s + 1e-6)
        self._owed_s -= steps * self.interval_s
        return steps

    def pause(self) -> None:
        """Let time pass without steps until the next call of `steps`."""
        self._last_s = None
        self._owed_s = 0.0


class Session:
    """Plays something: steps it, hands on what a person does, and logs what changes.

    Parameters
    ----------
    playable
        What is played.
    log
        Called with an entry at the start, and whenever it differs in anything but time from the one
        before: `time_s`, which has passed in the simulation; `is_watched`, `is_paused`, `speed`,
        `seed`, `is_recording`; `recording`, what the recorder says; `message`, why the latest
        change was refused; and `playable.figures()`.
    make_recorder
        Called before the first video; None: there are no videos.
    clock
        Tells time in s, to see how long the simulation takes.

    Attributes
    ----------
    is_watched, is_paused
        Whether somebody is there; whether time stands still all the same.
    speed
        Simulated time per time.
    keys
        Name of a key -> what a press does: the playable's, and "space", "enter", "backspace".
    camera
        From where it is seen.
    """

    def __init__(
        self,
        playable: Playable,
        log: Callable[[Mapping[str, Any]], None] = lambda entry: None,
        make_recorder: Callable[[], Recorder] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.playable: Final = playable
        self.keys: Final = {**playable.keys, **{key: tells for key, (_, tells) in _KEYS.items()}}
        self.camera = copy.copy(playable.camera)
        self.is_watched = False
        self.is_paused = False
        self.speed = 1.0
        self._log = log
        self._make_recorder = make_recorder
        self._recorder: Recorder | None = None
        self._clock = clock
        self._pace = Pace(playable.interval_s)
        self._film = Pace(1 / FRAMES_PER_S, max_lag_s=1.0)
        self._rate, self._rate_since = "", (math.inf, 0.0)
        self._next_seed = playable.seed
        self._message = ""
        self._told: dict[str, Any] | None = None
        self._tell()

    def watch(self, is_watched: bool) -> None:
        """Go on, since somebody watches; or else relax and wait."""
        self.is_watched = is_watched
        if not is_watched:
            self.playable.relax()
            self._stop_clocks()
            self._record(is_on=False)
        self._tell()

    def press(self, key: str) -> None:
        """Press a key; one that means nothing here, or while nobody watches, does nothing."""
        if key in _KEYS:
            self.change(_KEYS[key][0], True)
        elif self.is_watched and key in self.playable.keys:
            self.playable.press(key)
            self._tell()

    def point(self, x_w: float, y_w: float) -> None:
        """Click on the ground, mm in the world's frame."""
        if self.is_watched:
            self.playable.point(x_w, y_w)
            self._tell()

    def change(self, name: str, value: "Setting") -> None:
        """Set a control of the panel; a refusal is shown on the panel and logged.

        While nobody watches this does nothing.
        """
        if not self.is_watched:
            return
        try:
            if name in (PAUSE, STEP, RESET, SPEED, SEED, RECORD):
                self._change(name, value)
            else:
                self.playable.change(name, value)
            self._message = ""
        except ValueError as error:
            self._message = " ".join(str(error).split())
        self._tell()

    def advance(self, now_s: float) -> None:
        """Step the physics up to a time in s, of any clock that only goes forward."""
        if self.is_watched and not self.is_paused:
            self._step(self._pace.steps(now_s, self.speed))
            self._measure(now_s)
            self._take(self._film.steps(now_s))
        self._tell()

    def draw(self, panel: "Panel") -> None:
        """Draw the session's own controls, then those of what is played."""
        if panel.section("Time"):
            speed = next(name for name, speed in SPEEDS.items() if speed == self.speed)
            rate = "paused" if self.is_paused else self._rate
            panel.text(f"{self.playable.time_s:.2f} s   {rate}")
            panel.buttons(
                {PAUSE: "Go on" if self.is_paused else "Pause", STEP: "Step", RESET: "Reset"}
            )
            panel.choice(SPEED, "speed", tuple(SPEEDS), speed)
            panel.integer(SEED, "seed of a reset", self._next_seed)
            if self._make_recorder is not None:
                panel.switch(RECORD, "record a video", self._is_recording)
            for note in (self._recording, self._message):
                if note:
                    panel.text(note)
        self.playable.draw(panel)

    def close(self) -> None:
        """Finish the video that is being made, if any."""
        if self._recorder is not None:
            self._recorder.close()

    @property
    def _is_recording(self) -> bool:
        return self._recorder is not None and self._recorder.is_on

    @property
    def _recording(self) -> str:
        """Note of the recorder."""
        return self._recorder.note if self._recorder is not None else ""

    def _change(self, name: str, value: "Setting") -> None:
        if name == PAUSE:
            self._pause(not self.is_paused)
        elif name == STEP:
            self._pause(True)
            self.playable.step(1)
            self._take(1)
        elif name == RESET:
            self.playable.reset(self._next_seed)
            self._stop_clocks()
        elif name == SPEED:
            self.speed = SPEEDS[one_of("speed", str(value), SPEEDS)]
        elif name == SEED:
            self._next_seed = random_seed(int(value))
        else:
            self._record(is_on=bool(value))

    def _pause(self, is_paused: bool) -> None:
        self.is_paused = is_paused
        if is_paused:
            self._stop_clocks()

    def _stop_clocks(self) -> None:
        self._pace.pause()
        self._film.pause()
        self._rate, self._rate_since = "", (math.inf, 0.0)

    def _measure(self, now_s: float) -> None:
        """Measure how fast simulated time passes."""
        then_s, before_s = self._rate_since
        if math.isinf(then_s):
            self._rate_since = (now_s, self.playable.time_s)
        elif now_s - then_s >= _RATE_S:
            rate = (self.playable.time_s - before_s) / (now_s - then_s)
            self._rate = f"{rate:.2f} x real time"
            self._rate_since = (now_s, self.playable.time_s)

    def _record(self, is_on: bool) -> None:
        if self._make_recorder is None or self._is_recording == is_on:
            return
        if self._recorder is None:
            self._recorder = self._make_recorder()
        if not is_on:
            self._recorder.stop()
            return
        self._recorder.start()
        self._film.pause()
        self._take(1)

    def _step(self, due: int) -> None:
        """Take so many steps, as far as there is time."""
        bite = max(1, round(_BITE_S / self.playable.interval_s))
        end_s = self._clock() + BUDGET_S
        while due > 0 and self._clock() <= end_s:
            number = min(due, bite)
            self.playable.step(number)
            due -= number

    def _take(self, number: int) -> None:
        if number and self._recorder is not None and self._recorder.is_on:
            playable = self.playable
            self._recorder.take(playable.model, playable.data, self.camera, number)

    def _tell(self) -> None:
        entry = {
            "is_watched": self.is_watched,
            "is_paused": self.is_paused,
            "speed": self.speed,
            "seed": self.playable.seed,
            "is_recording": self._is_recording,
            "recording": self._recording,
            "message": self._message,
            **self.playable.figures(),
        }
        if entry != self._told:
            self._told = entry
            self._log({"time_s": round(self.playable.time_s, 4), **entry})
