"""Marks in pictures: what an `Overlay` shows, ribbons, arrows, legs coloured by what they do."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import LEG_SEGMENTS, LEGS
from flyrl.terrains import Ground, Terrain
from flyrl.validation import FloatArray


@dataclass(frozen=True)
class Overlay:
    """What is drawn into pictures; each can be switched off. The defaults are those of videos.

    Attributes
    ----------
    target
        A marker on the target, where there is one.
    leg_colours
        Tarsi coloured while they grip, tibiae on retraction, femora on stumbling. Of flies.
    trace
        The thorax's path, as a ribbon on the ground. Of flies.
    forces
        An arrow at every foot, of the ground's force on the leg. Of flies. A gripping leg pulls
        itself to the ground, so its arrow is mostly that of its grip.
    scale_bar
        A bar of a round length, as long as it would be at the body's distance.
    clock
        Simulated time, and how fast it plays.
    """

    target: bool = True
    leg_colours: bool = True
    trace: bool = True
    forces: bool = False
    scale_bar: bool = True
    clock: bool = True


PLAIN: Final = Overlay(leg_colours=False, trace=False, scale_bar=False, clock=False)
"""The body, and its target."""


FORCE_PER_MM: Final = 30.0
"""µN that an arrow of 1 mm stands for; a gripping leg is held with 40."""

LEAST_FORCE: Final = 1.0
"""µN; a tenth of the fly's weight. Weaker forces have no arrow."""

MAX_TRACE: Final = 400
"""Points of a path that are kept: 4 s at 100 pictures per s."""

_TRACE: Final = (0.96, 0.72, 0.12, 1.0)
_ARROW: Final = (0.95, 0.33, 0.05, 1.0)
_RIBBON_WIDTH: Final = 0.1
_ARROW_WIDTH: Final = 0.045
"""mm."""

_ABOVE: Final = 0.015
"""mm by which a ribbon lies above the ground."""


_NOWHERE, _UPRIGHT = np.zeros(3), np.eye(3).ravel()


@dataclass(frozen=True)
class Mark:
    """A ribbon or an arrow from one point to another, mm, world frame."""

    kind: mujoco.mjtGeom
    start: FloatArray
    end: FloatArray
    width: float
    rgba: tuple[float, float, float, float]


def add_marks(marks: Sequence[Mark], scene: mujoco.MjvScene) -> None:
    """Add marks to a scene that MuJoCo is about to draw, as many as it has room for."""
    for mark in marks[: scene.maxgeom - scene.ngeom]:
        geom = scene.geoms[scene.ngeom]
        colour = np.array(mark.rgba, dtype=np.float32)
        mujoco.mjv_initGeom(geom, mark.kind, _NOWHERE, _NOWHERE, _UPRIGHT, colour)
        if mark.kind == mujoco.mjtGeom.mjGEOM_BOX:
            _flatten(geom, mark)
        else:
            mujoco.mjv_connector(geom, mark.kind, mark.width, mark.start, mark.end)
        # as bright on the side away from the light
        geom.emission = 0.5
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        scene.ngeom += 1


def _flatten(geom: mujoco.MjvGeom, mark: Mark) -> None:
    """Make a box a ribbon that lies flat, from the start of a mark to its end."""
    # plain numbers: a path has hundreds of ribbons, and numpy takes 20 times as long for three
    along = (mark.end - mark.start).tolist()
    length = math.hypot(*along)
    x, y, z = (each / length for each in along)
    level = math.hypot(x, y)
    aside_x, aside_y = -y / level, x / level
    up = (-z * aside_y, z * aside_x, x * aside_y - y * aside_x)
    geom.pos[:] = (mark.start + mark.end) / 2
    geom.mat[:] = ((x, aside_x, up[0]), (y, aside_y, up[1]), (z, 0.0, up[2]))
    geom.size[:] = (length / 2, mark.width / 2, _ABOVE / 2)


def force_arrows(forces_w: FloatArray, feet_w: FloatArray) -> list[Mark]:
    """Arrows of the ground's forces at the feet.

    Parameters
    ----------
    forces_w
        On each sensed segment, µN, (36, 3), ordered as anatomy.CONTACT_SEGMENTS.
    feet_w
        Where the legs end, mm, (6, 3), ordered as anatomy.LEGS.
    """
    of_legs = forces_w.reshape(len(LEGS), -1, 3).sum(axis=1)
    return [
        Mark(
            mujoco.mjtGeom.mjGEOM_ARROW,
            foot,
            foot + force / FORCE_PER_MM,
            _ARROW_WIDTH,
            _ARROW,
        )
        for force, foot in zip(of_legs, feet_w, strict=True)
        if np.linalg.norm(force) >= LEAST_FORCE
    ]


class Trace:
    """Path of one fly on the ground.

    Parameters
    ----------
    terrain
        That it walks on.
    """

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        self._time = 0.0
        self._points: list[FloatArray] = []

    def add(self, time: float, thorax_w: FloatArray, ground: Ground) -> None:
        """Go on to where the thorax is, s and mm; with a time before the last, start anew.

        Across a gap the path goes on at the height before it.
        """
        if time < self._time:
            self._points.clear()
        self._time = time
        x, y = thorax_w[:2]
        top = self._terrain.top_at(ground, x, y)
        if top is None:
            top = self._points[-1][2] - _ABOVE if self._points else self._terrain.base_height
        self._points.append(np.array([x, y, top + _ABOVE]))
        del self._points[:-MAX_TRACE]

    def marks(self) -> list[Mark]:
        """Ribbons from each point to the next."""
        return [
            Mark(mujoco.mjtGeom.mjGEOM_BOX, start, end, _RIBBON_WIDTH, _TRACE)
            for start, end in itertools.pairwise(self._points)
            if math.dist(start[:2], end[:2]) > 1e-6
        ]


LEG_COLOURS: Final[dict[str, tuple[float, float, float]]] = {
    "grips": (0.13, 0.59, 1.0),
    "retracts": (0.93, 0.20, 0.80),
    "stumbles": (0.66, 0.93, 0.10),
}
"""Red, green and blue of a leg whose adhesion is on, or that a reflex (retraction, stumbling)
corrects."""

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
        for state, segments in _SEGMENTS.items():
            for leg, name in enumerate(LEGS):
                bodies = [model.body(f"{name}{segment}").id for segment in segments]
                geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies))
                self._parts.append((state, leg, geoms, model.geom_rgba[geoms].copy()))

    def apply(self, states: Mapping[str, NDArray[np.bool_]]) -> None:
        """Colour legs whose state is on, (6,) by name; give the others their usual colour."""
        for state, leg, geoms, usual in self._parts:
            colour = (*(_GLOW * np.array(LEG_COLOURS[state])), 1.0)
            self._model.geom_rgba[geoms] = colour if states[state][leg] else usual
