"""A live page in the browser: a simulation in real time that keys act on.

What is played (`playable`, `worm`), and its course in time (`session`), know nothing of the web;
`page` shows it with MuJoCo's web viewer, which `loopback` keeps to this computer.
"""

from collections.abc import Callable, Mapping
from typing import Final

from flyrl.play.playable import Playable
from flyrl.play.session import Session
from flyrl.play.worm import PlayedWorm

PLAYABLES: Final[Mapping[str, Callable[[], Playable]]] = {"worm": PlayedWorm}
"""What can be played, by name."""

__all__ = ["PLAYABLES", "Playable", "PlayedWorm", "Session"]
