"""What can be played."""

from collections.abc import Mapping
from typing import Protocol

import mujoco

from flyrl.play.panel import Section, Setting


class Playable(Protocol):
    """A simulation that a person acts on while it runs.

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
        `qpos`, `mocap_pos` and `mocap_quat` are drawn.
    camera
        From where it is seen at first.
    """

    title: str
    keys: Mapping[str, str]
    interval_s: float
    seed: int
    model: mujoco.MjModel
    data: mujoco.MjData
    camera: mujoco.MjvCamera

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset, s."""
        ...

    def step(self, number: int) -> None:
        """Simulate a number of steps."""

    def reset(self, seed: int) -> None:
        """Start again; the same seed starts the same."""

    def press(self, key: str) -> None:
        """Do what a key stands for, one of `keys`."""

    def change(self, name: str, value: Setting) -> None:
        """Set a widget of `sections`.

        Raises
        ------
        ValueError
            If it cannot be set so; everything is as before then.
        """

    def point(self, x_w: float, y_w: float) -> None:
        """Do what a click on the ground stands for, mm in the world's frame."""

    def relax(self) -> None:
        """Let go of all that a person holds, since nobody is there any more."""

    def sections(self) -> tuple[Section, ...]:
        """What the panel shows at the moment."""
        ...

    @property
    def hint(self) -> str:
        """A line that stands in the picture: the keys that matter at the moment."""
        ...

    def figures(self) -> Mapping[str, float | str | bool]:
        """What the log says at the moment, rounded to what is worth a line."""
        ...
