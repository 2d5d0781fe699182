"""The literature's worm in mid air, which keys recruit motor neurons of.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from flyrl.bodies.worm import DEMONSTRATION, WormConfig, build_worm
from flyrl.muscles import load_creature, movement
from flyrl.muscles.attachment import STEP, bend, last_neuron
from flyrl.play.session import Playable
from flyrl.simulation.worms import add_surroundings, side_view

if TYPE_CHECKING:
    from flyrl.play.panel import Panel, Setting

_CHANGES: Final = {"h": STEP, "n": -STEP}
"""Key -> change of the number of recruited neurons."""


class PlayedWorm(Playable):
    """A worm: h recruits `STEP` more motor neurons of all its muscles, n as many fewer.

    Attributes
    ----------
    n
        Neuron up to which its muscles are recruited, at most the last one of the longest pool.
    """

    title = "worm"
    keys: Mapping[str, str] = {"h": f"{STEP} more motor neurons", "n": f"{STEP} fewer"}
    hint = f"h: recruit {STEP} more motor neurons     n: {STEP} fewer"

    def __init__(self, config: WormConfig = DEMONSTRATION) -> None:
        spec = build_worm(config)
        add_surroundings(spec)
        self._creature = load_creature(spec, config.profile_path.parent)
        self._move = movement(self._creature)
        self.model, self.data = self._creature.model, self._creature.data
        self.camera = side_view(config)
        self.interval_s = float(self.model.opt.timestep)
        self.relax()

    def step(self) -> None:
        """Simulate a step of the physics."""
        mujoco.mj_step(self.model, self.data)

    def reset(self, seed: int) -> None:
        """Straighten up again; nothing of a worm is random, so every seed does the same."""
        self.seed = seed
        mujoco.mj_resetData(self.model, self.data)
        self.relax()

    def change(self, name: str, value: "Setting") -> None:
        """Recruit more neurons, or fewer."""
        self._activate(min(max(self.n + _CHANGES[name], 0), last_neuron(self._creature)))

    def relax(self) -> None:
        """Recruit the first neuron alone."""
        self._activate(0)

    def draw(self, panel: "Panel") -> None:
        """Draw neurons, tension of the first muscle, with a bar, and bend."""
        if panel.section("Worm"):
            tension = float(self._tension[0])
            panel.values(
                {"neurons up to": self.n, "tension": tension, "bend (°)": self._bend_deg()}
            )
            panel.bars({"": tension})

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
