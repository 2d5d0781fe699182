"""What is played, and its course in time: in real time or slower while somebody watches."""

import copy
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

import mujoco

from flyrl.play.recording import DRAWN, FRAMES_PER_S, VideoRecorder
from flyrl.validation import one_of, random_seed

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting

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


class Playable(Protocol):
    """A simulation that a person acts on while it runs; a subclass says what it is.

    Attributes
    ----------
    title
        Its name.
    keys
        Name of a key -> what a press does, in a few words. Letters, and "up", "down", "left",
        "right"; "click" tells what `point` does.
    interval_s
        Simulated time that a step takes, s.
    seed
        Of the last reset.
    model, data
        Of MuJoCo, to be drawn. The model is another object after the scene was changed; of the data
        the part `recording.DRAWN` of the state is drawn.
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

    def copy_into(self, data: mujoco.MjData) -> None:
        """Copy what is drawn into data of another copy of the model."""
        mujoco.mj_copyState(self.model, self.data, data, DRAWN)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset, s."""
        return float(self.data.time)

    @property
    def hint(self) -> str:
        """A line that stands in the picture: the keys that matter at the moment."""

    def step(self, number: int) -> None:
        """Simulate a number of steps."""

    def reset(self, seed: int) -> None:
        """Start again; the same seed starts the same."""

    def press(self, key: str) -> None:
        """Do what a key stands for, one of `keys`."""

    def relax(self) -> None:
        """Let go of all that a person holds, since nobody is there any more."""

    def draw(self, panel: "Panel") -> None:
        """Draw the panel's sections as they are at the moment."""

    def figures(self) -> Mapping[str, float | str | bool]:
        """Values for the log, rounded to what is worth a line."""

    def change(self, name: str, value: "Setting") -> None:
        """Set a control of the panel.

        Raises
        ------
        ValueError
            If it cannot be set so; everything is as before then.
        """
        raise ValueError(f"{self.title} has no {name!r} to set")

    def point(self, x_w: float, y_w: float) -> None:
        """Do what a click on the ground stands for, mm in the world's frame; by default nothing."""
        return


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
        Simulated time per time.
    keys
        Name of a key -> what a press does: the playable's, and "space", "enter", "backspace".
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
        self.keys: Final = {**playable.keys, **{key: tells for key, (_, tells) in _KEYS.items()}}
        self.camera = copy.copy(playable.camera)
        self.is_watched = False
        self.is_paused = False
        self.speed = 1.0
        self._recorder = recorder
        self._log = log
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
            panel.switch(RECORD, "record a video", self._recorder.is_on)
            for note in filter(None, (self._recorder.note, self._message)):
                panel.text(note)
        self.playable.draw(panel)

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
        if self._recorder.is_on and not is_on:
            self._recorder.stop()
        elif is_on and not self._recorder.is_on:
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
        if number and self._recorder.is_on:
            playable = self.playable
            self._recorder.take(playable.model, playable.data, self.camera, number)

    def _tell(self) -> None:
        entry = {
            "is_watched": self.is_watched,
            "is_paused": self.is_paused,
            "speed": self.speed,
            "seed": self.playable.seed,
            "is_recording": self._recorder.is_on,
            "recording": self._recorder.note,
            "message": self._message,
            **self.playable.figures(),
        }
        if entry != self._told:
            self._told = entry
            self._log({"time_s": round(self.playable.time_s, 4), **entry})
