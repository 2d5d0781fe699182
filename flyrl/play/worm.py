"""The literature's worm in mid air, which keys recruit motor neurons of.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from flyrl.bodies.worm import DEMONSTRATION, WormConfig, build_worm
from flyrl.muscles import load_creature, movement
from flyrl.play.panel import Bars, Section, Setting, Values
from flyrl.simulation.recruitment import STEP, bend, last_neuron
from flyrl.simulation.worm_scenery import add_surroundings, side_view

_CHANGES: Final = {"h": STEP, "n": -STEP}
"""By how much a key changes the number of recruited neurons."""


def after_press(n: int, key: str, last: int) -> int:
    """What muscles are activated with after a key was pressed.

    Parameters
    ----------
    n : what they are activated with, 0 to `last`.
    key : "h" for `STEP` more, "n" for `STEP` fewer.
    last : index of the last neuron.
    """
    return min(max(n + _CHANGES[key], 0), last)


class PlayedWorm:
    """A worm: h recruits `STEP` more motor neurons of all its muscles, n as many fewer.

    Attributes
    ----------
    n : what its muscles are activated with, 0 to the last neuron of the longest pool.
    title, keys, interval_s, time_s, seed, model, data, camera : see `Playable`.
    """

    def __init__(self, config: WormConfig = DEMONSTRATION) -> None:
        spec = build_worm(config)
        add_surroundings(spec)
        self._creature = load_creature(spec, config.profile_path.parent)
        self._move = movement(self._creature)
        self._last = last_neuron(self._creature)
        self.title = "worm"
        self.keys: Mapping[str, str] = {"h": f"{STEP} more motor neurons", "n": f"{STEP} fewer"}
        self.model, self.data = self._creature.model, self._creature.data
        self.camera = side_view(config)
        self.interval_s = float(self.model.opt.timestep)
        self.time_s, self.seed = 0.0, 0
        self._activate(0)

    def step(self, number: int) -> None:
        """Simulate a number of steps of the physics."""
        mujoco.mj_step(self.model, self.data, number)
        self.time_s = float(self.data.time)

    def reset(self, seed: int) -> None:
        """Straighten up again; nothing of a worm is random, so every seed does the same."""
        self.time_s, self.seed = 0.0, seed
        mujoco.mj_resetData(self.model, self.data)
        self._activate(0)

    def press(self, key: str) -> None:
        """Recruit more neurons, or fewer."""
        self._activate(after_press(self.n, key, self._last))

    @property
    def hint(self) -> str:
        """Keys that matter."""
        return f"h: recruit {STEP} more motor neurons     n: {STEP} fewer"

    def relax(self) -> None:
        """Recruit the first neuron alone."""
        self._activate(0)

    def change(self, name: str, value: Setting) -> None:
        """A worm has no widgets to set.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError(f"a worm has no {name!r} to set")

    def point(self, x_w: float, y_w: float) -> None:
        """There is no ground to click on."""

    def sections(self) -> tuple[Section, ...]:
        """Neurons, tension of the first muscle, and bend; a bar per muscle."""
        values = (self.n, float(self._tension[0]), self._bend_deg())
        shown = Values(("neurons up to", "tension", "bend (°)"), values)
        return (Section("Worm", (shown, Bars((), tuple(self._tension.tolist())))),)

    def figures(self) -> dict[str, float]:
        """`n`; `tension` of the first muscle, 0 to 1; `bend_deg`, the sum of all joints' angles."""
        return {
            "n": self.n,
            "tension": round(float(self._tension[0]), 4),
            # -0.0 becomes 0.0
            "bend_deg": round(self._bend_deg(), 1) + 0.0,
        }

    def _activate(self, n: int) -> None:
        self.n = n
        self._tension = self._move(np.full(len(self._creature.muscles), n))

    def _bend_deg(self) -> float:
        return float(np.degrees(bend(self._creature)))
