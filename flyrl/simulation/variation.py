"""Flies that differ from the scene's: fields of MuJoCo's model with a value per simulation."""

from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from flyrl.anatomy import JOINTS
from flyrl.simulation.randomisation import Randomisation

_SERVOS: Final = slice(0, len(JOINTS))
_GRIPS: Final = slice(len(JOINTS), None)

_SCALED: Final[dict[str, tuple[tuple[str, tuple[Any, ...]], ...]]] = {
    # contacts with planes are pairs, those with boxes take the figures of the leg's shape
    "friction": (("pair_friction", ()), ("geom_friction", ())),
    "mass": (("body_mass", ()), ("body_inertia", ())),
    # a servo's force is gain x target - stiffness x angle, with the same figure twice
    "actuator_gain": (("actuator_gainprm", (_SERVOS, 0)), ("actuator_biasprm", (_SERVOS, 1))),
    "adhesion": (("actuator_gainprm", (_GRIPS, 0)),),
}
"""Factor of a `Randomisation` -> fields that it scales, and which of their values."""


class Variation:
    """Scales the fields of a batch's model, simulation by simulation.

    A field is shared by all simulations until the first one differs: flies that never do cost
    nothing.
    """

    def __init__(self, model: mujoco.MjModel, batch: Batch) -> None:
        self._model = model
        self._batch = batch
        self._varied: set[str] = set()

    def apply(self, ids: NDArray[np.intp], randomisations: Sequence[Randomisation]) -> None:
        """Give simulations `ids` their factors, always on the figures of the scene's own fly."""
        for quantity, fields in _SCALED.items():
            factors = np.array([getattr(drawn, quantity) for drawn in randomisations])
            if quantity not in self._varied and (factors == 1.0).all():
                continue
            self._varied.add(quantity)
            for name, index in fields:
                own = getattr(self._model, name)[index]
                values = self._batch.expand(name)[(slice(None), *index)]
                values[ids] = own * factors.reshape(-1, *(1,) * own.ndim)
            if quantity == "mass":
                # what MuJoCo derives from masses when it compiles a model
                self._batch.set_const(ids)
