"""Videos of what is played: states are collected, and drawn when it is over, in a thread."""

import copy
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import imageio_ffmpeg
import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.files import usable_folder, write_bytes
from flyrl.report.captions import Picture
from flyrl.report.video import FPS, MAX_BYTES, encode
from flyrl.simulation.rendering import Offscreen, RenderingUnavailableError

WIDTH: Final = 480
HEIGHT: Final = 360
"""px."""

MAX_S: Final = 30
"""How long a video may be, s; it ends by itself then."""

_BYTES_S: Final = 10
"""A video may have `video.MAX_BYTES` for every so many seconds, or part of them."""


@dataclass(frozen=True)
class _Frame:
    """What is drawn: a state, and from where it is seen."""

    model: mujoco.MjModel
    qpos: NDArray[np.float64]
    mocap_pos: NDArray[np.float64]
    mocap_quat: NDArray[np.float64]
    camera: mujoco.MjvCamera


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
            imageio_ffmpeg.get_ffmpeg_exe()
            Offscreen(mujoco.MjSpec().compile(), WIDTH, HEIGHT).close()
        except (RenderingUnavailableError, RuntimeError, OSError) as error:
            self.note = _no_video(error)
            return
        self._frames = []
        self.is_on, self.note = True, "recording"

    def take(
        self, model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, number: int
    ) -> None:
        """Keep the state as that many pictures, 25 of which pass in a second."""
        frame = _Frame(
            model,
            data.qpos.copy(),
            data.mocap_pos.copy(),
            data.mocap_quat.copy(),
            copy.copy(camera),
        )
        room = round(MAX_S * FPS) - len(self._frames)
        self._frames += [frame] * min(number, room)
        if number >= room:
            self.stop()

    def stop(self) -> None:
        """Write what was collected, in a thread."""
        self.is_on = False
        frames, self._frames = self._frames, []
        if not frames:
            self.note = ""
            return
        self.note = f"Writing a video of {len(frames) / FPS:.1f} s ..."
        self._writing = threading.Thread(target=self._write, args=(frames,))
        self._writing.start()

    def close(self) -> None:
        """Write what was collected, and wait until it is there."""
        if self.is_on:
            self.stop()
        if self._writing is not None:
            self._writing.join()

    def _write(self, frames: list[_Frame]) -> None:
        try:
            path = _free_path(self._folder, self._name)
            tens = -(-len(frames) // (FPS * _BYTES_S))
            write_bytes(path, encode(list(_drawn(frames)), max_bytes=MAX_BYTES * tens))
            self.note = f"Video: {path}"
        except (RenderingUnavailableError, RuntimeError, OSError) as error:
            self.note = _no_video(error)


def _drawn(frames: list[_Frame]) -> Iterator[Picture]:
    """Draw frames; where the model becomes another one, it is set up anew."""
    left = 0
    while left < len(frames):
        model = frames[left].model
        shown = copy.deepcopy(model)
        shown.vis.quality.offsamples = 0
        shown.vis.global_.offwidth, shown.vis.global_.offheight = WIDTH, HEIGHT
        data = mujoco.MjData(shown)
        with closing(Offscreen(shown, WIDTH, HEIGHT)) as offscreen:
            while left < len(frames) and frames[left].model is model:
                yield _draw(shown, data, offscreen, frames[left])
                left += 1


def _draw(
    model: mujoco.MjModel, data: mujoco.MjData, offscreen: Offscreen, frame: _Frame
) -> Picture:
    data.qpos[:] = frame.qpos
    data.mocap_pos[:], data.mocap_quat[:] = frame.mocap_pos, frame.mocap_quat
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    return offscreen.draw(data, frame.camera)


def _free_path(folder: Path, name: str) -> Path:
    number = 1
    while (path := folder / f"{name}_{number}.mp4").exists():
        number += 1
    return path


def _no_video(error: Exception) -> str:
    return f"No video: {' '.join(str(error).split())}"
