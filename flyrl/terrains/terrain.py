"""The four terrains, as plain boxes and as MuJoCo geoms.

x points forward at spawn. All lengths in mm, world frame. Figures: NeuroMechFly v2
(doi:10.1038/s41592-024-02497-y).
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import BOXES, PLANES

Array = NDArray[np.float64]

TerrainName = Literal["flat", "gapped", "blocks", "mixed"]
TERRAIN_NAMES: Final[tuple[TerrainName, ...]] = get_args(TerrainName)

SPAWN_CLEARANCE: Final = 0.5
"""How far above `base_height` flies are put down, mm."""

GROUND_FRICTION: Final = (1.0, 0.005, 0.0001)
"""Sliding, torsional (mm), rolling (mm)."""

X_RANGE: Final = (-10.0, 25.0)
HALF_WIDTH: Final = 20.0
FLAT_HALF_SIZE: Final = 100.0

SLAB_WIDTH: Final = 1.0
SLAB_DEPTH: Final = 2.0
GAP_WIDTH: Final = 0.3
GAP_FLOOR: Final = -1.0

BLOCK_PITCH: Final = 1.3
BLOCK_OVERSIZE: Final = 1.1
"""Side of a block over the pitch."""
BLOCK_BASE: Final = 0.1

MIXED_START: Final = -4.0
MIXED_SEGMENT: Final = 9.0
MIXED_SEGMENTS: Final = 3
MIXED_COLUMNS: Final = 3


@dataclass(frozen=True)
class TerrainConfig:
    """Which ground.

    Attributes
    ----------
    name : "flat", "gapped" (slabs with gaps across the path), "blocks" (a chequerboard of heights)
        or "mixed" (blocks, gaps and flat ground in turn).
    seed : of the random heights; without effect where height_range is a single height.
    height_range : least and greatest height by which every other block stands out, mm; blocks and
        mixed only.
    """

    name: TerrainName = "flat"
    seed: int = 0
    height_range: tuple[float, float] = (0.35, 0.35)

    def __post_init__(self) -> None:
        if self.name not in TERRAIN_NAMES:
            raise ValueError(
                f"terrain name: got {self.name!r}, allowed are {', '.join(TERRAIN_NAMES)}"
            )
        if type(self.seed) is not int or self.seed < 0:
            raise ValueError(f"terrain seed: got {self.seed!r}, allowed are integers >= 0")
        heights = tuple(self.height_range)
        if (
            len(heights) != 2
            or not all(math.isfinite(height) for height in heights)
            or not 0 <= heights[0] <= heights[1]
        ):
            raise ValueError(
                f"height_range: got {self.height_range!r}, allowed are two heights in mm with "
                "0 <= least <= greatest"
            )
        object.__setattr__(self, "height_range", heights)


@dataclass(frozen=True)
class Bounds:
    """Extent of the ground to walk on, mm."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float


@dataclass(frozen=True)
class Boxes:
    """Axis-aligned boxes.

    Attributes
    ----------
    centres : (n, 3) mm.
    half_sizes : (n, 3) mm.
    """

    centres: Array
    half_sizes: Array

    @property
    def tops(self) -> Array:
        """Height of the upper faces, (n,) mm."""
        tops: Array = self.centres[:, 2] + self.half_sizes[:, 2]
        return tops


def base_height(config: TerrainConfig) -> float:
    """Height of the ground that spawn heights count from, mm."""
    return {"gapped": GAP_FLOOR + SLAB_DEPTH, "blocks": BLOCK_BASE}.get(config.name, 0.0)


def terrain_bounds(config: TerrainConfig) -> Bounds:
    """Where there is ground to walk on."""
    if config.name == "flat":
        return Bounds(-FLAT_HALF_SIZE, FLAT_HALF_SIZE, -FLAT_HALF_SIZE, FLAT_HALF_SIZE)
    x_min, x_max = X_RANGE
    if config.name == "mixed":
        x_min, x_max = MIXED_START, MIXED_START + MIXED_SEGMENTS * MIXED_SEGMENT
    return Bounds(x_min, x_max, -HALF_WIDTH, HALF_WIDTH)


def terrain_boxes(config: TerrainConfig) -> Boxes:
    """Boxes that the terrain is built of; none on flat ground."""
    if config.name == "gapped":
        return _gapped()
    if config.name == "blocks":
        columns = _pitches(X_RANGE[1] - X_RANGE[0])
        rng = np.random.default_rng(config.seed)
        return _blocks(X_RANGE[0], columns, rng, config.height_range, lower=0.0)
    if config.name == "mixed":
        return _mixed(config)
    return Boxes(np.empty((0, 3)), np.empty((0, 3)))


def add_terrain(spec: mujoco.MjSpec, config: TerrainConfig) -> None:
    """Add the ground, its materials and a sky to `spec`.

    Ground geoms are called `ground_…` and have contype `bodies.fly.PLANES` or `BOXES`, conaffinity
    0: they touch what asks to be touched, and not each other.
    """
    _add_sky(spec)
    if config.name == "flat":
        _add_grid_material(spec)
        _add_plane(spec, "ground", (0, 0, 0), (FLAT_HALF_SIZE, FLAT_HALF_SIZE), "ground_grid")
        return
    boxes = terrain_boxes(config)
    spec.add_material(name="ground_block", specular=0.05, shininess=0.1)
    for index, (centre, half_size) in enumerate(zip(boxes.centres, boxes.half_sizes, strict=True)):
        spec.worldbody.add_geom(
            name=f"ground_{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=centre,
            size=half_size,
            material="ground_block",
            rgba=_shade(index, boxes.tops[index], boxes.tops),
            contype=BOXES,
            **_GROUND,
        )
    if config.name in ("blocks", "mixed"):
        # Where level boxes overlap, MuJoCo's shadow pass lights their faces twice.
        for light in spec.lights:
            light.castshadow = False
    if config.name == "blocks":
        return  # the blocks leave no gap
    bounds = terrain_bounds(config)
    centre = ((bounds.x_min + bounds.x_max) / 2, 0, GAP_FLOOR)
    spec.add_material(name="ground_floor", rgba=(0.20, 0.21, 0.24, 1), specular=0.0)
    _add_plane(spec, "ground_floor", centre, (bounds.x_max - centre[0], HALF_WIDTH), "ground_floor")


_GROUND: Final = {
    "conaffinity": 0,
    "group": 0,
    "friction": GROUND_FRICTION,
}


def _gapped() -> Boxes:
    x = np.arange(X_RANGE[0] + SLAB_WIDTH / 2, X_RANGE[1], SLAB_WIDTH + GAP_WIDTH)
    return _slabs(x, np.full_like(x, SLAB_WIDTH), top=GAP_FLOOR + SLAB_DEPTH)


def _slabs(x_centres: Array, widths: Array, top: float) -> Boxes:
    """Slabs across the whole width, with the given centres and widths in x."""
    centres = np.zeros((len(x_centres), 3))
    centres[:, 0] = x_centres
    centres[:, 2] = top - SLAB_DEPTH / 2
    half_sizes = np.empty_like(centres)
    half_sizes[:, 0] = widths / 2
    half_sizes[:, 1] = HALF_WIDTH
    half_sizes[:, 2] = SLAB_DEPTH / 2
    return Boxes(centres, half_sizes)


def _pitches(extent: float) -> int:
    """Number of blocks whose centres lie within `extent`, the first half a pitch inside."""
    return math.ceil(extent / BLOCK_PITCH - 0.5)


def _blocks(
    x_min: float,
    columns: int,
    rng: np.random.Generator,
    height_range: tuple[float, float],
    lower: float,
) -> Boxes:
    """Chequerboard of blocks; `lower` sinks all of it.

    The low blocks are level: they are one box here, the first, which gives the same surface with
    half the boxes. Then the high ones, column by column in x.
    """
    corner = np.array((x_min, -HALF_WIDTH))
    cells = np.array((columns, _pitches(2 * HALF_WIDTH)))
    high = np.argwhere(np.add.outer(*map(np.arange, cells)) % 2 == 0)
    heights = rng.uniform(*height_range, size=len(high))
    tops = BLOCK_BASE + np.append(0.0, heights)
    bottom = -BLOCK_PITCH
    overhang = (BLOCK_OVERSIZE - 1) * BLOCK_PITCH / 2
    centres, half_sizes = np.empty((2, len(tops), 3))
    centres[0, :2] = corner + BLOCK_PITCH * cells / 2
    centres[1:, :2] = corner + BLOCK_PITCH * (high + 0.5)
    centres[:, 2] = (tops + bottom) / 2 - lower
    half_sizes[0, :2] = BLOCK_PITCH * cells / 2 + overhang
    half_sizes[1:, :2] = BLOCK_PITCH / 2 + overhang
    half_sizes[:, 2] = (tops - bottom) / 2
    return Boxes(centres, half_sizes)


def _mixed(config: TerrainConfig) -> Boxes:
    rng = np.random.default_rng(config.seed)
    lower = BLOCK_BASE + sum(config.height_range) / 2
    parts = []
    for segment in range(MIXED_SEGMENTS):
        start = MIXED_START + segment * MIXED_SEGMENT
        blocks_end = start + MIXED_COLUMNS * BLOCK_PITCH
        parts.append(_blocks(start, MIXED_COLUMNS, rng, config.height_range, lower))
        edges = np.cumsum([blocks_end, SLAB_WIDTH / 2, GAP_WIDTH, SLAB_WIDTH, GAP_WIDTH])
        starts, ends = edges[[0, 2, 4]], np.append(edges[[1, 3]], start + MIXED_SEGMENT)
        parts.append(_slabs((starts + ends) / 2, ends - starts, top=0.0))
    return Boxes(
        np.concatenate([part.centres for part in parts]),
        np.concatenate([part.half_sizes for part in parts]),
    )


def _add_plane(
    spec: mujoco.MjSpec,
    name: str,
    centre: tuple[float, float, float],
    half_size: tuple[float, float],
    material: str,
) -> None:
    """A plane; it is drawn to `half_size` and touched everywhere."""
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        contype=PLANES,
        pos=centre,
        size=(*half_size, 1.0),
        material=material,
        **_GROUND,
    )


def _shade(index: int, top: float, tops: Array) -> tuple[float, float, float, float]:
    """Grey-green that gets lighter with height; where all are level, neighbours alternate."""
    low, high = float(tops.min()), float(tops.max())
    share = (top - low) / (high - low) if high > low else float(index % 2)
    dark, light = np.array([0.33, 0.37, 0.36]), np.array([0.72, 0.73, 0.66])
    red, green, blue = dark + (light - dark) * share
    return float(red), float(green), float(blue), 1.0


def _add_grid_material(spec: mujoco.MjSpec) -> None:
    """Chequered material with squares of 1 mm, for scale."""
    spec.add_texture(
        name="ground_grid",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(0.66, 0.68, 0.65),
        rgb2=(0.52, 0.55, 0.54),
        width=256,
        height=256,
    )
    material = spec.add_material(name="ground_grid", specular=0.05, shininess=0.1)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground_grid"
    # One picture holds 2 x 2 squares.
    material.texuniform = True
    material.texrepeat = (0.5, 0.5)


def _add_sky(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.97),
        rgb2=(0.62, 0.70, 0.78),
        width=256,
        height=1536,
    )
