"""Videos of what is played: states are collected, and drawn when it is over, in a thread."""

import copy
import itertools
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from flyrl.files import usable_folder, write_bytes
from flyrl.simulation.rendering import Offscreen, Picture
from flyrl.validation import FloatArray

WIDTH: Final = 480
HEIGHT: Final = 360
"""px."""

FRAMES_PER_S: Final = 25
"""Pictures of a video per second of the screen's time."""

MAX_S: Final = 30
"""Longest video, s; it ends by itself then."""

_BYTES: Final = 2 * 10**6
"""A video may have so many for every 10 s, or part of them."""

_STATE: Final = int(mujoco.mjtState.mjSTATE_INTEGRATION)

_Frame = tuple[mujoco.MjModel, FloatArray, mujoco.MjvCamera]
"""A picture to draw: of a model in a state, and from where it is seen."""


class VideoRecorder:
    """Collects states while something is played, and writes a video of them.

    Parameters
    ----------
    folder
        Where videos come, as `<name>_<n>.mp4`; made when the first one is begun.
    name
        Of what is played.

    Attributes
    ----------
    is_on
        Whether it collects.
    note
        What a person should know: that a video is being written, where it lies, why there is none.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.is_on = False
        self.note = ""
        self._folder, self._name = folder, name
        self._frames: list[_Frame] = []
        self._writing: threading.Thread | None = None

    def start(self) -> None:
        """Begin a video, if pictures can be drawn and the one before is written; else say why."""
        if self._writing is not None and self._writing.is_alive():
            self.note = "The video before is still being written; begin again when it is there."
            return
        try:
            usable_folder(self._folder)
            Offscreen(mujoco.MjSpec().compile(), WIDTH, HEIGHT).close()
        except (RuntimeError, OSError) as error:
            self.note = _no_video(error)
            return
        self.is_on, self.note = True, "recording"

    def take(
        self, model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, number: int
    ) -> None:
        """Keep the state as that many pictures, `FRAMES_PER_S` of which pass in a second."""
        state = np.empty(mujoco.mj_stateSize(model, _STATE))
        mujoco.mj_getState(model, data, state, _STATE)
        room = round(MAX_S * FRAMES_PER_S) - len(self._frames)
        self._frames += [(model, state, copy.copy(camera))] * min(number, room)
        if number >= room:
            self.stop()

    def stop(self) -> None:
        """Write what was collected, in a thread: this returns before the video is there."""
        if not self.is_on:
            return
        self.is_on, self.note = False, ""
        frames, self._frames = self._frames, []
        if frames:
            self.note = f"Writing a video of {len(frames) / FRAMES_PER_S:.1f} s ..."
            self._writing = threading.Thread(target=self._write, args=(frames,))
            self._writing.start()

    def close(self) -> None:
        """Write what was collected, and wait until it is there."""
        self.stop()
        if self._writing is not None:
            self._writing.join()

    def _write(self, frames: list[_Frame]) -> None:
        # with Matplotlib, for which nobody needs to wait who records nothing
        from flyrl.report.video import encode  # noqa: PLC0415

        paths = (self._folder / f"{self._name}_{number}.mp4" for number in itertools.count(1))
        path = next(path for path in paths if not path.exists())
        tens = -(-len(frames) // (FRAMES_PER_S * 10))
        try:
            write_bytes(path, encode(list(_drawn(frames)), FRAMES_PER_S, max_bytes=_BYTES * tens))
            self.note = f"Video: {path}"
        except (RuntimeError, OSError) as error:
            self.note = _no_video(error)


def _drawn(frames: list[_Frame]) -> Iterator[Picture]:
    """Draw frames; where the model becomes another one, it is set up anew."""
    for _, group in itertools.groupby(frames, key=lambda frame: id(frame[0])):
        alike = list(group)
        shown = copy.deepcopy(alike[0][0])
        data = mujoco.MjData(shown)
        with closing(Offscreen(shown, WIDTH, HEIGHT)) as offscreen:
            for _, state, camera in alike:
                mujoco.mj_setState(shown, data, state, _STATE)
                mujoco.mj_forward(shown, data)
                yield offscreen.draw(data, camera)


def _no_video(error: Exception) -> str:
    return f"No video: {' '.join(str(error).split())}"
