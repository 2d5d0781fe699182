"""The literature's rough grounds: gaps, blocks, and both in turn.

Figures: NeuroMechFly v2 (doi:10.1038/s41592-024-02497-y).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flyrl.terrains.terrain import Bounds, Boxes, Terrain, joined
from flyrl.validation import FloatArray, Within, ordered

Ids = NDArray[np.intp]

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

RANDOM_HEIGHTS: Final = (0.15, 0.45)
RANDOM_GAPS: Final = (0.1, 0.45)
"""Usual ranges of random ground, mm, about the literature's 0.35 and 0.3."""

MIXED_START: Final = -4.0
MIXED_SEGMENT: Final = 9.0
MIXED_COLUMNS: Final = 3


class _Layout(NamedTuple):
    """Where the boxes of a terrain stand.

    Attributes
    ----------
    boxes : with gaps of GAP_WIDTH and without heights.
    blocks, high : ids of the blocks, and of those among them that stand out.
    before_gap : ids of the slabs behind which there is a gap, and then the next slab.
    """

    boxes: Boxes
    blocks: Ids
    high: Ids
    before_gap: Ids


@dataclass(frozen=True, kw_only=True)
class _Rough(Terrain):
    """Boxes whose heights and gaps are drawn from ranges: the base of all three."""

    half_width: Annotated[float, Within(5, 1000)] = 20.0

    def _parts(self) -> list[tuple[Boxes, bool]]:
        """Blocks (True) or slabs, front to back: what is drawn is drawn in this order."""
        raise NotImplementedError

    @cached_property
    def layout(self) -> _Layout:
        """Where the boxes stand."""
        parts = self._parts()
        sizes = [len(boxes.centres) for boxes, _ in parts]
        ends = np.cumsum(sizes)
        is_block = np.repeat([is_blocks for _, is_blocks in parts], sizes)
        is_first, is_last = np.zeros((2, ends[-1]), dtype=bool)
        is_first[ends - sizes] = is_last[ends - 1] = True
        return _Layout(
            joined(boxes for boxes, _ in parts),
            np.flatnonzero(is_block),
            np.flatnonzero(is_block & ~is_first),
            np.flatnonzero(~is_block & ~is_last),
        )

    @property
    def _ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Of heights and gaps, mm."""
        return (
            getattr(self, "height_range", (0.0, 0.0)),
            getattr(self, "gap_range", (GAP_WIDTH, GAP_WIDTH)),
        )

    def boxes(self, rng: np.random.Generator, difficulty: float) -> Boxes:
        """Draw the heights and gaps, each uniformly from its range; `difficulty` scales them."""
        height_range, gap_range = self._ranges
        heights = rng.uniform(*height_range, size=len(self.layout.high))
        gaps = rng.uniform(*gap_range, size=len(self.layout.before_gap))
        return self._raised(difficulty * heights, difficulty * gaps, difficulty)

    def hull(self) -> Boxes:
        """Boxes of which each holds its like in every ground, at any difficulty."""
        (lowest, highest), (narrowest, widest) = self._ranges
        grounds = [
            self._raised(*drawn)
            for drawn in ((lowest, narrowest, 1.0), (highest, widest, 1.0), (0.0, 0.0, 0.0))
        ]
        low = np.min([ground.centres - ground.half_sizes for ground in grounds], axis=0)
        high = np.max([ground.centres + ground.half_sizes for ground in grounds], axis=0)
        return Boxes((low + high) / 2, (high - low) / 2)

    def _raised(
        self, heights: FloatArray | float, gaps: FloatArray | float, difficulty: float
    ) -> Boxes:
        """Give the layout its heights and gaps, mm."""
        layout = self.layout
        centres, half_sizes = layout.boxes.centres.copy(), layout.boxes.half_sizes.copy()
        tops = np.full(len(centres), BLOCK_BASE)
        tops[layout.high] += heights
        sunk = self._sunk(difficulty)
        top, bottom = tops[layout.blocks], -BLOCK_PITCH
        centres[layout.blocks, 2] = (top + bottom) / 2 - sunk
        half_sizes[layout.blocks, 2] = (top - bottom) / 2
        # a gap grows to both sides; a slab's half size is half of what is left
        shift = (np.zeros(len(layout.before_gap)) + gaps - GAP_WIDTH) / 2
        for slabs, sign in ((layout.before_gap, -1), (layout.before_gap + 1, 1)):
            centres[slabs, 0] += sign * shift / 2
            half_sizes[slabs, 0] -= shift / 2
        return Boxes(centres, half_sizes)

    def _sunk(self, difficulty: float) -> float:
        """How far the blocks are sunk, mm."""
        return 0.0


@dataclass(frozen=True, kw_only=True)
class _Strip(_Rough):
    """Rough ground of any length."""

    x_range: Annotated[tuple[float, float], Within(-1000, 1000)] = (-10.0, 25.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        ordered("terrain.x_range", self.x_range)

    @property
    def bounds(self) -> Bounds:
        """Where there is ground to walk on."""
        return Bounds(*self.x_range, -self.half_width, self.half_width)


@dataclass(frozen=True, kw_only=True)
class Gapped(_Strip):
    """Slabs of 1 mm with gaps across the path.

    Attributes
    ----------
    gap_range : least and greatest width of a gap, mm. Their middles stay where they are.
    x_range : where the ground starts and ends, mm.
    half_width : to both sides, mm.
    """

    gap_range: Annotated[tuple[float, float], Within(0, MAX_GAP)] = (GAP_WIDTH, GAP_WIDTH)

    drawn_from = ("gap_range",)
    base_height = GAP_FLOOR + SLAB_DEPTH
    floor = GAP_FLOOR

    def _parts(self) -> list[tuple[Boxes, bool]]:
        x = np.arange(self.x_range[0] + SLAB_WIDTH / 2, self.x_range[1], SLAB_WIDTH + GAP_WIDTH)
        widths = np.full_like(x, SLAB_WIDTH)
        return [(_slabs(x, widths, self.base_height, self.half_width), False)]


@dataclass(frozen=True, kw_only=True)
class Blocks(_Strip):
    """A chequerboard of blocks, 1.3 mm wide.

    Attributes
    ----------
    height_range : least and greatest height by which every other block stands out, mm.
    x_range : where the ground starts and ends, mm.
    half_width : to both sides, mm.
    """

    height_range: Annotated[tuple[float, float], Within(0, MAX_HEIGHT)] = (0.35, 0.35)

    drawn_from = ("height_range",)
    base_height = BLOCK_BASE
    floor = None

    def _parts(self) -> list[tuple[Boxes, bool]]:
        columns = _pitches(self.x_range[1] - self.x_range[0])
        return [(_blocks(self.x_range[0], columns, self.half_width), True)]


@dataclass(frozen=True, kw_only=True)
class Mixed(_Rough):
    """Blocks, gaps and flat ground in turn, 9 mm each time.

    Attributes
    ----------
    height_range : least and greatest height by which every other block stands out, mm.
    gap_range : least and greatest width of a gap, mm.
    segments : how often; the first starts at x = -4.
    half_width : to both sides, mm.
    """

    height_range: Annotated[tuple[float, float], Within(0, MAX_HEIGHT)] = (0.35, 0.35)
    gap_range: Annotated[tuple[float, float], Within(0, MAX_GAP)] = (GAP_WIDTH, GAP_WIDTH)
    segments: Annotated[int, Within(1, 100)] = 3

    drawn_from = ("height_range", "gap_range")
    floor = GAP_FLOOR

    @property
    def bounds(self) -> Bounds:
        """Where there is ground to walk on."""
        x_max = MIXED_START + self.segments * MIXED_SEGMENT
        return Bounds(MIXED_START, x_max, -self.half_width, self.half_width)

    def _parts(self) -> list[tuple[Boxes, bool]]:
        parts: list[tuple[Boxes, bool]] = []
        for segment in range(self.segments):
            start = MIXED_START + segment * MIXED_SEGMENT
            blocks_end = start + MIXED_COLUMNS * BLOCK_PITCH
            parts.append((_blocks(start, MIXED_COLUMNS, self.half_width), True))
            edges = np.cumsum([blocks_end, SLAB_WIDTH / 2, GAP_WIDTH, SLAB_WIDTH, GAP_WIDTH])
            starts, ends = edges[[0, 2, 4]], np.append(edges[[1, 3]], start + MIXED_SEGMENT)
            slabs = _slabs((starts + ends) / 2, ends - starts, 0.0, self.half_width)
            parts.append((slabs, False))
        return parts

    def _sunk(self, difficulty: float) -> float:
        return BLOCK_BASE + difficulty * (sum(self.height_range) / 2)


def _slabs(x_centres: FloatArray, widths: FloatArray, top: float, half_width: float) -> Boxes:
    """Slabs across the whole width, with the given centres and widths in x."""
    centres = np.zeros((len(x_centres), 3))
    centres[:, 0] = x_centres
    centres[:, 2] = top - SLAB_DEPTH / 2
    half_sizes = np.empty_like(centres)
    half_sizes[:, 0] = widths / 2
    half_sizes[:, 1] = half_width
    half_sizes[:, 2] = SLAB_DEPTH / 2
    return Boxes(centres, half_sizes)


def _pitches(extent: float) -> int:
    """Number of blocks whose centres lie within `extent`, the first half a pitch inside."""
    return math.ceil(extent / BLOCK_PITCH - 0.5)


def _blocks(x_min: float, columns: int, half_width: float) -> Boxes:
    """Chequerboard of blocks, without their extent in z.

    The low blocks are level: they are one box here, the first, which gives the same surface with
    half the boxes. Then the high ones, column by column in x.
    """
    corner = np.array((x_min, -half_width))
    cells = np.array((columns, _pitches(2 * half_width)))
    high = np.argwhere(np.add.outer(*map(np.arange, cells)) % 2 == 0)
    overhang = (BLOCK_OVERSIZE - 1) * BLOCK_PITCH / 2
    centres, half_sizes = np.zeros((2, 1 + len(high), 3))
    centres[0, :2] = corner + BLOCK_PITCH * cells / 2
    centres[1:, :2] = corner + BLOCK_PITCH * (high + 0.5)
    half_sizes[0, :2] = BLOCK_PITCH * cells / 2 + overhang
    half_sizes[1:, :2] = BLOCK_PITCH / 2 + overhang
    return Boxes(centres, half_sizes)
