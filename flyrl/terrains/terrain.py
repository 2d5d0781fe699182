"""The four terrains, as plain boxes and as MuJoCo geoms.

x points forward at spawn. All lengths in mm, world frame. Figures: NeuroMechFly v2
(doi:10.1038/s41592-024-02497-y).
"""

import functools
import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import BOXES, PLANES
from flyrl.validation import Within, check_fields, within

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

TerrainName = Literal["flat", "gapped", "blocks", "mixed"]
TERRAIN_NAMES: Final[tuple[TerrainName, ...]] = get_args(TerrainName)

SPAWN_CLEARANCE: Final = 0.5
"""How far above `base_height` flies are put down, mm."""

GROUND_FRICTION: Final = (1.0, 0.005, 0.0001)
"""Sliding, torsional (mm), rolling (mm)."""

X_RANGE: Final = (-10.0, 25.0)
HALF_WIDTH: Final = 20.0
FLAT_GROUND: Final = "ground"
"""Name of the plane on flat terrain."""
FLAT_HALF_SIZE: Final = 100.0

SLAB_WIDTH: Final = 1.0
SLAB_DEPTH: Final = 2.0
GAP_WIDTH: Final = 0.3
GAP_FLOOR: Final = -1.0
MAX_HEIGHT: Final = 100.0
MAX_GAP: Final = 1.0
"""Gaps keep their distance of SLAB_WIDTH + GAP_WIDTH: a wider one leaves narrower slabs."""

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
    seed : of the heights and gaps of a ground that is the same in every episode; without effect
        where both ranges are a single value.
    height_range : least and greatest height by which every other block stands out, mm; blocks and
        mixed only.
    gap_range : least and greatest width of a gap, mm; gapped and mixed only. The middles of the
        gaps stay where they are.
    random : whether every episode has a ground of its own, with other heights and gaps.
    """

    name: TerrainName = "flat"
    seed: Annotated[int, Within(0, 2**63 - 1)] = 0
    height_range: Annotated[tuple[float, float], Within(0, MAX_HEIGHT)] = (0.35, 0.35)
    gap_range: Annotated[tuple[float, float], Within(0, MAX_GAP)] = (GAP_WIDTH, GAP_WIDTH)
    random: bool = False

    def __post_init__(self) -> None:
        check_fields(self, "terrain")
        for key in ("height_range", "gap_range"):
            least, greatest = getattr(self, key)
            if least > greatest:
                raise ValueError(
                    f"terrain.{key} must be (least, greatest), got {(least, greatest)}"
                )
        drawn = _DRAWN[self.name]
        if self.random and all(len(set(getattr(self, key))) == 1 for key in drawn):
            missing = " or ".join(drawn)
            raise ValueError(
                f"terrain.random: got {self.random!r}, but "
                + (
                    f"{self.name} ground has no heights or gaps to draw; allowed is false"
                    if not drawn
                    else f"nothing is drawn as long as {missing} is a single value; give two"
                )
            )

    @property
    def label(self) -> str:
        """The name as tables and folders have it, with "random_" before it on random ground."""
        return terrain_label(self.name, self.random)


def terrain_label(name: str, random: object) -> str:
    """Name of a terrain in tables and folders; a record of old says nothing of `random`."""
    return f"random_{name}" if random is True else name


_DRAWN: Final[dict[TerrainName, tuple[str, ...]]] = {
    "flat": (),
    "gapped": ("gap_range",),
    "blocks": ("height_range",),
    "mixed": ("height_range", "gap_range"),
}
"""What is drawn of a terrain."""

TERRAINS: Final[dict[str, TerrainConfig]] = {
    **{name: TerrainConfig(name) for name in TERRAIN_NAMES},
    "random_gapped": TerrainConfig("gapped", gap_range=(0.1, 0.45), random=True),
    "random_blocks": TerrainConfig("blocks", height_range=(0.15, 0.45), random=True),
    "random_mixed": TerrainConfig(
        "mixed", height_range=(0.15, 0.45), gap_range=(0.1, 0.45), random=True
    ),
}
"""Terrains that go by a name; the random ones lie about the literature's 0.35 mm and 0.3 mm."""


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
    """Boxes that a scene is compiled with; none on flat ground.

    On random ground each is large enough to hold its like in every ground that can be drawn, at
    any difficulty: MuJoCo works out at compile time where to look for contacts.
    """
    if not config.random:
        return draw_ground(config, config.seed)
    grounds = [
        _raise(config, heights, gaps, difficulty)
        for heights, gaps, difficulty in (
            (config.height_range[0], config.gap_range[0], 1.0),
            (config.height_range[1], config.gap_range[1], 1.0),
            (0.0, 0.0, 0.0),
        )
    ]
    low = np.min([ground.centres - ground.half_sizes for ground in grounds], axis=0)
    high = np.max([ground.centres + ground.half_sizes for ground in grounds], axis=0)
    return Boxes((low + high) / 2, (high - low) / 2)


def draw_ground(config: TerrainConfig, seed: int, difficulty: float = 1.0) -> Boxes:
    """Draw the heights and gaps of a ground, each uniformly from its range.

    Parameters
    ----------
    config
        Its own `seed` has no say.
    seed
        The same seed gives the same bits. A terrain that is not random is
        `draw_ground(config, config.seed)`.
    difficulty
        Factor on all heights and gaps, from 0 (level ground without gaps) to 1 (as drawn).

    Raises
    ------
    ValueError
        If the difficulty is out of its range.
    """
    within("difficulty", difficulty, 0, 1)
    layout = _layout(config.name)
    rng = np.random.default_rng(seed)
    heights = rng.uniform(*config.height_range, size=len(layout.high))
    gaps = rng.uniform(*config.gap_range, size=len(layout.before_gap))
    return _raise(config, difficulty * heights, difficulty * gaps, difficulty)


def box_colours(boxes: Boxes) -> Array:
    """Grey-greens that get lighter with height, RGBA (n, 4).

    Where all boxes are level, neighbours alternate.
    """
    low, high = boxes.tops.min(), boxes.tops.max()
    shares = (boxes.tops - low) / (high - low) if high > low else np.arange(len(boxes.tops)) % 2.0
    dark, light = np.array([0.33, 0.37, 0.36]), np.array([0.72, 0.73, 0.66])
    return np.insert(dark + (light - dark) * shares[:, None], 3, 1.0, axis=1)


def add_terrain(spec: mujoco.MjSpec, config: TerrainConfig) -> None:
    """Add the ground, its materials and a sky to `spec`.

    Ground geoms are called `ground_…` and have contype `bodies.fly.PLANES` or `BOXES`, conaffinity
    0: they touch what asks to be touched, and not each other. The boxes of `terrain_boxes` are
    `ground_0`, `ground_1`, … with consecutive ids.
    """
    _add_sky(spec)
    if config.name == "flat":
        _add_grid_material(spec)
        size = (FLAT_HALF_SIZE, FLAT_HALF_SIZE)
        _add_plane(spec, FLAT_GROUND, (0, 0, 0), size, "ground_grid")
        return
    boxes = terrain_boxes(config)
    spec.add_material(name="ground_block", specular=0.05, shininess=0.1)
    colours = box_colours(boxes)
    for index, (centre, half_size) in enumerate(zip(boxes.centres, boxes.half_sizes, strict=True)):
        spec.worldbody.add_geom(
            name=f"ground_{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=centre,
            size=half_size,
            material="ground_block",
            rgba=colours[index],
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


@dataclass(frozen=True)
class _Layout:
    """Where the boxes of a terrain stand.

    Attributes
    ----------
    boxes : with gaps of GAP_WIDTH and without heights.
    blocks, high : ids of the blocks, and of those among them that stand out.
    before_gap, after_gap : ids of the slabs on both sides of each gap.
    """

    boxes: Boxes
    blocks: Ids
    high: Ids
    before_gap: Ids
    after_gap: Ids


@functools.cache
def _layout(name: TerrainName) -> _Layout:
    """Lay out a terrain, front to back: what is drawn is drawn in this order."""
    parts: list[tuple[Boxes, bool]] = []
    if name == "gapped":
        x = np.arange(X_RANGE[0] + SLAB_WIDTH / 2, X_RANGE[1], SLAB_WIDTH + GAP_WIDTH)
        parts = [(_slabs(x, np.full_like(x, SLAB_WIDTH), top=GAP_FLOOR + SLAB_DEPTH), False)]
    elif name == "blocks":
        parts = [(_blocks(X_RANGE[0], _pitches(X_RANGE[1] - X_RANGE[0])), True)]
    elif name == "mixed":
        for segment in range(MIXED_SEGMENTS):
            start = MIXED_START + segment * MIXED_SEGMENT
            blocks_end = start + MIXED_COLUMNS * BLOCK_PITCH
            parts.append((_blocks(start, MIXED_COLUMNS), True))
            edges = np.cumsum([blocks_end, SLAB_WIDTH / 2, GAP_WIDTH, SLAB_WIDTH, GAP_WIDTH])
            starts, ends = edges[[0, 2, 4]], np.append(edges[[1, 3]], start + MIXED_SEGMENT)
            parts.append((_slabs((starts + ends) / 2, ends - starts, top=0.0), False))
    boxes, blocks, high, before_gap = [np.empty((2, 0, 3))], [], [], []
    count = 0
    for part, is_blocks in parts:
        ids = np.arange(count, count + len(part.centres))
        count += len(ids)
        boxes.append(np.stack([part.centres, part.half_sizes]))
        if is_blocks:
            blocks.append(ids)
            high.append(ids[1:])
        else:
            before_gap.append(ids[:-1])
    before = _joined(before_gap)
    return _Layout(
        Boxes(*np.concatenate(boxes, axis=1)), _joined(blocks), _joined(high), before, before + 1
    )


def _joined(ids: list[Ids]) -> Ids:
    return np.concatenate([np.empty(0, dtype=np.intp), *ids])


def _raise(
    config: TerrainConfig, heights: Array | float, gaps: Array | float, difficulty: float
) -> Boxes:
    """Give the layout of a terrain its heights and gaps, mm.

    `difficulty` scales how far the blocks of mixed ground are sunk, by the mean height.
    """
    layout = _layout(config.name)
    centres, half_sizes = layout.boxes.centres.copy(), layout.boxes.half_sizes.copy()
    tops = np.full(len(centres), BLOCK_BASE)
    tops[layout.high] += heights
    sunk = BLOCK_BASE + difficulty * (sum(config.height_range) / 2) if config.name == "mixed" else 0
    top, bottom = tops[layout.blocks], -BLOCK_PITCH
    centres[layout.blocks, 2] = (top + bottom) / 2 - sunk
    half_sizes[layout.blocks, 2] = (top - bottom) / 2
    # a gap grows to both sides; a slab's half size is half of what is left
    shift = (np.zeros(len(layout.before_gap)) + gaps - GAP_WIDTH) / 2
    for slabs, sign in ((layout.before_gap, -1), (layout.after_gap, 1)):
        centres[slabs, 0] += sign * shift / 2
        half_sizes[slabs, 0] -= shift / 2
    return Boxes(centres, half_sizes)


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


def _blocks(x_min: float, columns: int) -> Boxes:
    """Chequerboard of blocks, without their extent in z.

    The low blocks are level: they are one box here, the first, which gives the same surface with
    half the boxes. Then the high ones, column by column in x.
    """
    corner = np.array((x_min, -HALF_WIDTH))
    cells = np.array((columns, _pitches(2 * HALF_WIDTH)))
    high = np.argwhere(np.add.outer(*map(np.arange, cells)) % 2 == 0)
    overhang = (BLOCK_OVERSIZE - 1) * BLOCK_PITCH / 2
    centres, half_sizes = np.zeros((2, 1 + len(high), 3))
    centres[0, :2] = corner + BLOCK_PITCH * cells / 2
    centres[1:, :2] = corner + BLOCK_PITCH * (high + 0.5)
    half_sizes[0, :2] = BLOCK_PITCH * cells / 2 + overhang
    half_sizes[1:, :2] = BLOCK_PITCH / 2 + overhang
    return Boxes(centres, half_sizes)


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
    # One picture holds 2 x 2 squares; of what it is told, MuJoCo lays half as many per mm.
    material.texuniform = True
    material.texrepeat = (1.0, 1.0)


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
