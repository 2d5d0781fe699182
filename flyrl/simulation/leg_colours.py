"""Legs coloured by what they do, in pictures."""

from typing import Final

import mujoco
import numpy as np

from flyrl.anatomy import LEG_SEGMENTS, LEGS
from flyrl.simulation.state import LegStates

LEG_COLOURS: Final[dict[str, tuple[float, float, float]]] = {
    "grips": (0.13, 0.59, 1.0),
    "retracts": (0.93, 0.20, 0.80),
    "stumbles": (0.66, 0.93, 0.10),
}
"""Red, green and blue, by field of `LegStates`."""

_GLOW: Final = 1.5
"""How much brighter a leg is painted, which light meets from one side; GL cuts off what is beyond
white."""

_SEGMENTS: Final[dict[str, tuple[str, ...]]] = {
    "grips": LEG_SEGMENTS[3:],
    "retracts": ("Tibia",),
    "stumbles": ("Femur",),
}


class LegColours:
    """Colours tarsi while they grip, a tibia on retraction, a femur on stumbling.

    Parameters
    ----------
    model
        With the body's meshes; a leg that is missing has none. Its colours now are the usual ones.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._parts = []
        for field, segments in _SEGMENTS.items():
            leg_of_body = {
                model.body(f"{leg}{segment}").id: index
                for index, leg in enumerate(LEGS)
                for segment in segments
            }
            geoms = np.flatnonzero(np.isin(model.geom_bodyid, list(leg_of_body)))
            legs = np.array([leg_of_body[body] for body in model.geom_bodyid[geoms]], dtype=int)
            self._parts.append((field, geoms, legs, model.geom_rgba[geoms].copy()))

    def apply(self, states: LegStates) -> None:
        """Colour what is on, and give what is off its usual colour."""
        for field, geoms, legs, usual in self._parts:
            is_on = getattr(states, field)[legs, np.newaxis]
            colour = (*(_GLOW * np.array(LEG_COLOURS[field])), 1.0)
            self._model.geom_rgba[geoms] = np.where(is_on, colour, usual)
