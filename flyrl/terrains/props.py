"""Props: things that stand or move on the ground, solid or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import mujoco

from flyrl.bodies.fly import BOXES, PROPS
from flyrl.terrains.geoms import GROUND_FRICTION
from flyrl.terrains.terrain import Array
from flyrl.validation import Within, check_fields

Shape = Literal["sphere", "cylinder", "box", "marker"]

Path = Callable[[Array, Array], Array]
"""From starts (n, 3), mm, and the time since the reset (n,), s, to positions (n, 3), mm."""

_SIZES: Final[dict[str, int]] = {"sphere": 1, "cylinder": 2, "box": 3, "marker": 1}

NOWHERE: Final = (0.0, 0.0, -100.0)
"""Out of sight: where a prop is that an episode does without."""


@dataclass(frozen=True)
class Prop:
    """A thing on the ground; where it stands belongs to an episode.

    Attributes
    ----------
    name
        Differs from those of the task's other props.
    shape, size
        "sphere" (radius,), "cylinder" (radius, height), standing, "box" (lengths along x, y and z),
        or "marker" (radius,): a disc on the ground, with a pole. mm.
    rgba
        Colour, each from 0 to 1.
    is_solid
        Whether it stops legs and trunk of a fly; what is not solid is walked through.
    at_goal
        Whether it stands where the episode leads to, on the ground, instead of at a place of its
        own.
    path
        Moves it, once per decision; None: it rests. At 0 s it is at its start.

    Raises
    ------
    ValueError
        A value that is not allowed.
    """

    name: str
    shape: Shape
    size: Annotated[tuple[float, ...], Within(1e-3, 1e3)]
    rgba: Annotated[tuple[float, float, float, float], Within(0, 1)] = (0.25, 0.28, 0.35, 1.0)
    is_solid: bool = False
    at_goal: bool = False
    path: Path | None = None

    def __post_init__(self) -> None:
        path = self.path
        object.__setattr__(self, "path", None)  # a function has no rule to be checked by
        check_fields(self, f"prop {self.name!r}")
        object.__setattr__(self, "path", path)
        if len(self.size) != _SIZES[self.shape]:
            raise ValueError(
                f"size of prop {self.name!r} must be {_SIZES[self.shape]} numbers for a "
                f"{self.shape}, got {self.size}"
            )
        if self.shape == "marker" and self.is_solid:
            raise ValueError(f"is_solid of prop {self.name!r} must be False for a marker")

    @property
    def height(self) -> float:
        """From its lowest to its highest point, mm."""
        if self.shape == "sphere":
            return 2 * self.size[0]
        return 0.0 if self.shape == "marker" else self.size[-1]


TARGET_MARKER: Final = Prop("target", "marker", (1.0,), (0.85, 0.2, 0.2, 0.6), at_goal=True)
"""Marks what a task leads to."""


def add_prop(spec: mujoco.MjSpec, prop: Prop) -> None:
    """Add a mocap body of a prop's name, out of sight until it is moved."""
    body = spec.worldbody.add_body(name=prop.name, mocap=True, pos=NOWHERE)
    kinds, size = mujoco.mjtGeom, prop.size
    parts: dict[str, list[tuple[mujoco.mjtGeom, tuple[float, ...], float]]] = {
        "sphere": [(kinds.mjGEOM_SPHERE, (size[0], 0.0, 0.0), 0.0)],
        "cylinder": [(kinds.mjGEOM_CYLINDER, (size[0], size[-1] / 2, 0.0), 0.0)],
        "box": [(kinds.mjGEOM_BOX, tuple(each / 2 for each in size), 0.0)],
        "marker": [
            (kinds.mjGEOM_CYLINDER, (size[0], 0.02, 0.0), 0.0),
            (kinds.mjGEOM_CYLINDER, (0.05 * size[0], size[0], 0.0), size[0]),
        ],
    }
    for kind, extent, height in parts[prop.shape]:
        body.add_geom(
            type=kind,
            size=extent,
            pos=[0.0, 0.0, height],
            rgba=prop.rgba,
            contype=BOXES | PROPS if prop.is_solid else 0,
            conaffinity=0,
            friction=GROUND_FRICTION,
            group=1,
        )
