"""What makes a video of what is played; made elsewhere, since it needs pictures."""

from typing import Final, Protocol

import mujoco

FRAMES_PER_S: Final = 25
"""Pictures of a video per second of the screen's time."""


class Recorder(Protocol):
    """Collects what is to be seen, and makes a video of it.

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
