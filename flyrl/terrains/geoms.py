"""Ground, and props on it, as geoms of MuJoCo.

Props are things that stand or move on the ground, solid or not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import mujoco
import numpy as np

from flyrl.bodies.fly import BOXES, PLANES, PROPS
from flyrl.terrains.terrain import Bounds, Boxes, Heights, Terrain
from flyrl.validation import FloatArray, Within, check_fields

GROUND_FRICTION: Final = (1.0, 0.005, 0.0001)
"""Sliding, torsional (mm), rolling (mm)."""

FLAT_GROUND: Final = "ground"
"""Name of the plane where there is nothing but that."""

FLOOR: Final = "ground_floor"
"""Name of the plane below boxes or a height field."""

GROUP: Final = "ground_group_"
"""Names of the bodies of groups of boxes begin so; the number of the group follows."""

HEIGHT_FIELD: Final = "ground_heights"

_WALKED_ON: Final = 0.01
"""mm; a plane that lies no lower than so below the base height is chequered, others are dark."""

Colour = tuple[float, float, float]

GROUND_GEOM: Final = {"conaffinity": 0, "group": 0, "friction": GROUND_FRICTION}
"""What all geoms of the ground have in common."""


def add_terrain(spec: mujoco.MjSpec, terrain: Terrain) -> None:
    """Add the ground, its materials and a sky to `spec`.

    Ground geoms are called `ground_…` and have contype `bodies.fly.PLANES` or `BOXES`, conaffinity
    0: they touch what asks to be touched, and not each other. The boxes of `terrain.compiled` are
    `ground_0`, `ground_1`, … with consecutive ids.
    """
    add_sky(spec, (0.93, 0.95, 0.97), (0.62, 0.70, 0.78), pixels=256)
    ground, heights = terrain.compiled(), terrain.heights()
    has_boxes = len(ground.boxes.centres) > 0
    if has_boxes:
        _add_boxes(spec, ground.boxes, terrain.groups)
    if heights is not None and ground.shift is not None:
        _add_heights(spec, heights, ground.shift)
    terrain.add_to(spec)
    if ground.floor is not None:
        is_walked_on = ground.floor >= terrain.base_height - _WALKED_ON
        name = FLOOR if has_boxes or heights is not None else FLAT_GROUND
        _add_plane(spec, name, ground.floor, terrain.bounds, is_walked_on)


def add_sky(spec: mujoco.MjSpec, top: Colour, bottom: Colour, pixels: int) -> None:
    """Add a sky whose colour, red, green and blue, changes from top to bottom."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=top,
        rgb2=bottom,
        width=pixels,
        height=6 * pixels,
    )


def box_colours(boxes: Boxes) -> FloatArray:
    """Grey-greens that get lighter with height, RGBA (n, 4).

    Where all boxes are level, neighbours alternate.
    """
    low, high = boxes.tops.min(), boxes.tops.max()
    shares = (boxes.tops - low) / (high - low) if high > low else np.arange(len(boxes.tops)) % 2.0
    dark, light = np.array([0.33, 0.37, 0.36]), np.array([0.72, 0.73, 0.66])
    return np.insert(dark + (light - dark) * shares[:, None], 3, 1.0, axis=1)


def _add_boxes(spec: mujoco.MjSpec, boxes: Boxes, groups: Sequence[slice]) -> None:
    spec.add_material(name="ground_block", specular=0.05, shininess=0.1)
    colours = box_colours(boxes)
    bodies = []
    for i in range(len(groups)):
        # where a group is sunk, MuJoCo leaves out all of its boxes at once
        bodies.append(spec.worldbody.add_body(name=f"{GROUP}{i}"))
        # what nothing refers to would be merged into the world
        spec.add_exclude(bodyname1="world", bodyname2=f"{GROUP}{i}")
    for body, group in zip(bodies or [spec.worldbody], groups or [slice(None)], strict=True):
        for index in range(*group.indices(len(boxes.centres))):
            body.add_geom(
                name=f"ground_{index}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=boxes.centres[index],
                size=boxes.half_sizes[index],
                mass=0,
                material="ground_block",
                rgba=colours[index],
                contype=BOXES,
                **GROUND_GEOM,
            )
    if _overlap(boxes):
        # Where level boxes overlap, MuJoCo's shadow pass lights their faces twice.
        for light in spec.lights:
            light.castshadow = False


def _overlap(boxes: Boxes) -> bool:
    """Whether the first box lies under another one, seen from above."""
    apart = np.abs(boxes.centres[1:, :2] - boxes.centres[0, :2])
    return bool((apart < boxes.half_sizes[1:, :2] + boxes.half_sizes[0, :2]).all(axis=1).any())


def _add_heights(spec: mujoco.MjSpec, heights: Heights, shift: tuple[float, float, float]) -> None:
    low, high = heights.values.min(), heights.values.max()
    rows, columns = heights.values.shape
    spec.add_hfield(
        name=HEIGHT_FIELD,
        nrow=rows,
        ncol=columns,
        # what is below the lowest place is solid, too
        size=(*heights.half_extent, max(high - low, 1e-6), 2.0),
        userdata=((heights.values - low) / max(high - low, 1e-6)).ravel(),
    )
    spec.add_material(name=HEIGHT_FIELD, rgba=(0.52, 0.55, 0.5, 1), specular=0.05, shininess=0.1)
    spec.worldbody.add_geom(
        name=HEIGHT_FIELD,
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=HEIGHT_FIELD,
        pos=(shift[0], shift[1], shift[2] + low),
        material=HEIGHT_FIELD,
        contype=BOXES,
        **GROUND_GEOM,
    )


def _add_plane(
    spec: mujoco.MjSpec, name: str, height: float, bounds: Bounds, is_walked_on: bool
) -> None:
    """Add a plane: drawn as far as there is ground, and touched everywhere."""
    if is_walked_on:
        material = add_checks(spec, "ground_grid", mujoco.mjtTexture.mjTEXTURE_2D, pixels=256)
        # One picture holds 2 x 2 squares of 1 mm; MuJoCo lays half as many per mm as asked for.
        material.texuniform = True
        material.texrepeat = (1.0, 1.0)
    else:
        material = spec.add_material(name=FLOOR, rgba=(0.20, 0.21, 0.24, 1), specular=0.0)
    middle = (bounds.x_min + bounds.x_max) / 2, (bounds.y_min + bounds.y_max) / 2
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        contype=PLANES,
        pos=(*middle, height),
        size=(bounds.x_max - middle[0], bounds.y_max - middle[1], 1.0),
        material=material.name,
        **GROUND_GEOM,
    )


def add_checks(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtTexture, pixels: int
) -> mujoco.MjsMaterial:
    """Add a chequered material, as it is laid on the ground; return it."""
    spec.add_texture(
        name=name,
        type=kind,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(0.66, 0.68, 0.65),
        rgb2=(0.52, 0.55, 0.54),
        width=pixels,
        height=pixels,
    )
    material = spec.add_material(name=name, specular=0.05, shininess=0.1)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    return material


# ------------------------------------------------------------------ props

Shape = Literal["sphere", "cylinder", "box", "marker"]

Path = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""From starts (n, 3), mm, the time since the reset (n,), s, and what episodes ask for (n, size of
their command) to positions (n, 3), mm."""

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
        check_fields(self, f"prop {self.name!r}")
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
