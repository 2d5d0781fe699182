"""A live page in the browser: a simulation in real time that a person acts on.

What is played (`fly`, `worm`: a `Playable`), and its course in time (`Session`), know nothing of
the web; `page` shows it with MuJoCo's web viewer, which `loopback` keeps to this computer.
"""

from flyrl.play.fly import PlayedFly
from flyrl.play.fly_setting import PlayedFlyConfig
from flyrl.play.playable import Playable
from flyrl.play.session import Session
from flyrl.play.worm import PlayedWorm

__all__ = ["Playable", "PlayedFly", "PlayedFlyConfig", "PlayedWorm", "Session"]
