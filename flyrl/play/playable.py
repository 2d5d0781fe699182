"""A body in play: what the page asks of it, and what it answers where it has nothing of its own."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import mujoco

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting


class Playable:
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
        `qpos`, `mocap_pos` and `mocap_quat` are drawn.
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
        raise NotImplementedError

    def step(self, number: int) -> None:
        """Simulate a number of steps."""
        raise NotImplementedError

    def reset(self, seed: int) -> None:
        """Start again; the same seed starts the same."""
        raise NotImplementedError

    def press(self, key: str) -> None:
        """Do what a key stands for, one of `keys`."""
        raise NotImplementedError

    def relax(self) -> None:
        """Let go of all that a person holds, since nobody is there any more."""
        raise NotImplementedError

    def draw(self, panel: "Panel") -> None:
        """Draw the panel's sections as they are at the moment."""
        raise NotImplementedError

    def figures(self) -> Mapping[str, float | str | bool]:
        """Values for the log, rounded to what is worth a line."""
        raise NotImplementedError

    def change(self, name: str, value: "Setting") -> None:
        """Set a control of the panel.

        Raises
        ------
        ValueError
            If it cannot be set so; everything is as before then.
        """
        raise ValueError(f"{self.title} has no {name!r} to set")

    def point(self, x_w: float, y_w: float) -> None:
        """Do what a click on the ground stands for, mm in the world's frame."""
