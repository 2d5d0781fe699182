"""Surfaces of bodies: their contact with planes and boxes, under gravity, and how they look."""

from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Final, Literal

import mujoco

from flyrl.anatomy import LEG_SEGMENTS
from flyrl.validation import Within, check_fields, one_of

GRAVITY: Final = (0.0, 0.0, -9810.0)
"""mm/s²."""
COLLISION_GROUP: Final = 3
"""Of geoms that touch."""
VISUAL_GROUP: Final = 1
"""Of geoms that are drawn."""
HIDDEN_GROUP: Final = 5
"""Of geoms that would be drawn, but for an episode without them."""

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


def touching(ground: int, contact: SurfaceContact) -> dict[str, Any]:
    """Properties of a shape of a leg that meets the ground's shapes of one contact bit."""
    return {
        "mass": 0,
        "group": COLLISION_GROUP,
        "contype": 0,
        "conaffinity": ground,
        # A higher priority than the ground's makes these figures those of the contact.
        "priority": 1,
        "rgba": (0.2, 0.5, 0.9, 0.5),
        **asdict(contact),
    }


Vector = tuple[float, float, float]
Colour = tuple[float, float, float, float]

_COLOURS: Final[dict[str, Colour]] = {
    "Thorax": (0.50, 0.33, 0.17, 1.0),
    "Head": (0.56, 0.38, 0.20, 1.0),
    "Eye": (0.48, 0.07, 0.06, 1.0),
    "Wing": (0.74, 0.80, 0.88, 0.28),
    "Haltere": (0.82, 0.70, 0.46, 1.0),
    "Pedicel": (0.66, 0.47, 0.26, 1.0),
    "Funiculus": (0.72, 0.52, 0.29, 1.0),
    "Arista": (0.22, 0.16, 0.12, 1.0),
    "Rostrum": (0.70, 0.52, 0.31, 1.0),
    "Haustellum": (0.74, 0.57, 0.36, 1.0),
    "A1A2": (0.78, 0.60, 0.34, 1.0),
    "A3": (0.72, 0.53, 0.28, 1.0),
    "A4": (0.62, 0.44, 0.22, 1.0),
    "A5": (0.46, 0.31, 0.15, 1.0),
    "A6": (0.27, 0.18, 0.10, 1.0),
    "Coxa": (0.76, 0.57, 0.27, 1.0),
    "Femur": (0.80, 0.62, 0.31, 1.0),
    "Tibia": (0.84, 0.67, 0.36, 1.0),
    "Tarsus": (0.71, 0.53, 0.29, 1.0),
}
"""Colour by the part of a body's name that it contains; the longest match wins."""


def add_material(spec: mujoco.MjSpec, body: str) -> str:
    """Material of a body by its name, added to the specification if it is not there; its name."""
    part = max((key for key in _COLOURS if key in body), key=len)
    if spec.material(part) is None:
        shiny = part in ("Eye", "Wing")
        spec.add_material(
            name=part,
            rgba=_COLOURS[part],
            specular=0.5 if shiny else 0.15,
            shininess=0.6 if shiny else 0.2,
        )
    return part


def add_sun(
    body: mujoco.MjsBody, pos: Vector, direction: Vector, diffuse: Vector, follows: bool
) -> None:
    """Add a directional light at a place of a body, mm.

    One that follows the body casts shadows, which MuJoCo draws only near its aim.
    """
    modes = mujoco.mjtCamLight
    body.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        mode=modes.mjCAMLIGHT_TRACK if follows else modes.mjCAMLIGHT_FIXED,
        pos=pos,
        dir=direction,
        diffuse=diffuse,
        specular=(0.2, 0.2, 0.2),
        castshadow=follows,
    )


def set_look(
    spec: mujoco.MjSpec, extent: float, ambient: float, diffuse: float, specular: float
) -> None:
    """Set extent, mm, and headlight of a scene; software rendering without multisampling."""
    spec.visual.quality.offsamples = 0
    spec.visual.quality.shadowsize = 1024
    spec.stat.extent = extent
    spec.visual.map.znear = 0.01
    spec.visual.map.zfar = 60.0
    spec.visual.map.shadowclip = 2.0
    spec.visual.headlight.ambient = (ambient,) * 3
    spec.visual.headlight.diffuse = (diffuse,) * 3
    spec.visual.headlight.specular = (specular,) * 3
