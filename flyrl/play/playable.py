"""What can be played."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import mujoco


class Panel(NamedTuple):
    """What stands on the panel beside the picture.

    Attributes
    ----------
    heading, details : a line each.
    bars : a bar per muscle, one below the other; how full it is, 0 to 1.
    """

    heading: str
    details: str
    bars: tuple[float, ...]


class Playable(Protocol):
    """A simulation that keys act on.

    Attributes
    ----------
    title
        Its name.
    keys
        Letter -> what a press does, in a few words.
    model, data
        Of MuJoCo; whoever plays it steps them.
    camera
        From where it is seen at first.
    """

    title: str
    keys: Mapping[str, str]
    model: mujoco.MjModel
    data: mujoco.MjData
    camera: mujoco.MjvCamera

    def press(self, key: str) -> None:
        """Do what a key stands for, one of `keys`."""

    def relax(self) -> None:
        """Let go of all that keys have done."""

    def panel(self) -> Panel:
        """What the panel says at the moment."""
        ...

    def figures(self) -> Mapping[str, float]:
        """What the log says at the moment, rounded to what is worth a line."""
        ...
