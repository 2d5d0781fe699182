"""How legs touch the ground: MuJoCo's contact parameters, for planes and for boxes."""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from flyrl.anatomy import LEG_SEGMENTS

PlaneShape = Literal["capsule", "hull"]


@dataclass(frozen=True)
class SurfaceContact:
    """Contact of a leg segment with one kind of surface; MuJoCo's contact parameters.

    The defaults are the literature's (doi:10.1038/s41592-024-02497-y): so stiff and overdamped that
    a foot stops within a step of 1e-4 s and sinks in by next to nothing.

    Attributes
    ----------
    friction : sliding, torsional (mm), rolling (mm).
    solref : time constant (s) and damping ratio, or -stiffness and -damping, both negative.
    solimp : impedance: minimum, maximum, width (mm), midpoint, power.
    condim : 3 for sliding friction, 4 with torsional, 6 with rolling friction as well, 1 for none.
    margin : distance at which contacts become active, mm.
    """

    friction: tuple[float, float, float] = (1.0, 0.005, 0.0001)
    solref: tuple[float, float] = (2e-4, 1e3)
    solimp: tuple[float, float, float, float, float] = (0.999, 0.9999, 0.001, 0.5, 2.0)
    condim: int = 3
    margin: float = 0.0

    def __post_init__(self) -> None:
        for key, length in {"friction": 3, "solref": 2, "solimp": 5}.items():
            value = getattr(self, key)
            if len(value) != length or not all(math.isfinite(item) for item in value):
                raise ValueError(f"{key}: got {value!r}, allowed are {length} finite numbers")
        if min(self.friction) < 0:
            raise ValueError(f"friction: got {self.friction!r}, allowed are numbers >= 0")
        if (self.solref[0] > 0) != (self.solref[1] > 0) or 0 in self.solref:
            raise ValueError(
                f"solref: got {self.solref!r}, allowed are two positive numbers (time constant, "
                "damping ratio) or two negative ones (-stiffness, -damping)"
            )
        if self.condim not in (1, 3, 4, 6):
            raise ValueError(f"condim: got {self.condim!r}, allowed are 1, 3, 4, 6")
        if not (math.isfinite(self.margin) and self.margin >= 0):
            raise ValueError(f"margin: got {self.margin!r}, allowed is a finite number >= 0")


@dataclass(frozen=True)
class ContactConfig:
    """How leg segments touch the ground.

    Attributes
    ----------
    plane : contact with planes: flat ground, the floor of gaps.
    box : contact with boxes. A foot that has sunk into the wall of a box holds the fly unless it is
        pushed out again; how fast decides who gets stuck on rough ground.
    plane_shape : what a leg segment is to planes: a "hull", as to boxes and as in the published
        models; or a "capsule", which takes fewer contacts, and of which MuJoCo's "discrete"
        integrator treats left and right alike.
    plane_segments : the leg segments that touch planes, of anatomy.LEG_SEGMENTS; all of them touch
        boxes. On stiff flat ground a fly stands on its Tarsus5 alone; on a soft one, into which
        those sink, the other tarsus segments would touch too, and grip.
    plane_friction_across : sliding friction of a capsule on a plane across its axis, where the
        plane's own then holds along it; None: the same in all directions.
    """

    plane: SurfaceContact = field(default_factory=SurfaceContact)
    box: SurfaceContact = field(default_factory=SurfaceContact)
    plane_shape: PlaneShape = "capsule"
    plane_segments: tuple[str, ...] = LEG_SEGMENTS
    plane_friction_across: float | None = None

    def __post_init__(self) -> None:
        if self.plane_shape not in get_args(PlaneShape):
            raise ValueError(
                f"plane_shape: got {self.plane_shape!r}, allowed are "
                f"{', '.join(get_args(PlaneShape))}"
            )
        unknown = [name for name in self.plane_segments if name not in LEG_SEGMENTS]
        if unknown:
            raise ValueError(
                f"plane_segments: got {unknown[0]!r}, allowed are {', '.join(LEG_SEGMENTS)}"
            )
        across = self.plane_friction_across
        if across is not None and not (math.isfinite(across) and across >= 0):
            raise ValueError(f"plane_friction_across: got {across!r}, allowed is a number >= 0")
        if across is not None and self.plane_shape != "capsule":
            raise ValueError(
                f"plane_friction_across: got {across!r}; a {self.plane_shape} has no axis, allowed "
                "is None"
            )
