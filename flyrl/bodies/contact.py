"""Contact of bodies with the ground: MuJoCo's parameters, for planes and for boxes; gravity."""

from dataclasses import dataclass, field
from typing import Annotated, Final, Literal

from flyrl.anatomy import LEG_SEGMENTS
from flyrl.validation import Within, check_fields, one_of

GRAVITY: Final = (0.0, 0.0, -9810.0)
"""mm/s²."""
COLLISION_GROUP: Final = 3
"""Of geoms that touch."""

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

    friction: Annotated[tuple[float, float, float], Within(0, 1e3)] = (1.0, 0.005, 0.0001)
    solref: Annotated[tuple[float, float], Within(-1e9, 1e9)] = (2e-4, 1e3)
    solimp: Annotated[tuple[float, float, float, float, float], Within(0, 1e3)] = (
        0.999, 0.9999, 0.001, 0.5, 2.0,
    )  # fmt: skip
    condim: Literal[1, 3, 4, 6] = 3
    margin: Annotated[float, Within(0, 10)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "contact")
        if (self.solref[0] > 0) != (self.solref[1] > 0) or 0 in self.solref:
            raise ValueError(
                f"solref: got {self.solref!r}, allowed are two positive numbers (time constant, "
                "damping ratio) or two negative ones (-stiffness, -damping)"
            )


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
    plane_friction_across: Annotated[float | None, Within(0, 1e3)] = None

    def __post_init__(self) -> None:
        check_fields(self, "contact")
        for name in self.plane_segments:
            one_of("contact.plane_segments", name, LEG_SEGMENTS)
        across = self.plane_friction_across
        if across is not None and self.plane_shape != "capsule":
            raise ValueError(
                f"plane_friction_across: got {across!r}; a {self.plane_shape} has no axis, allowed "
                "is None"
            )
