"""Ground of any kind: every episode draws one of the other terrains, all in one compiled scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Final, Literal, get_args

import numpy as np

from flyrl.terrains.rough import (
    MAX_GAP,
    MAX_HEIGHT,
    MIXED_SEGMENT,
    MIXED_START,
    RANDOM_GAPS,
    RANDOM_HEIGHTS,
    Blocks,
    Gapped,
    Mixed,
)
from flyrl.terrains.smooth import HILLS_EDGE, Flat, Hills, Slope
from flyrl.terrains.terrain import Bounds, Boxes, Ground, Heights, Terrain, joined, off_origin
from flyrl.validation import Within, distinct, ordered

Kind = Literal["flat", "gapped", "blocks", "mixed", "hills", "slope"]

USUAL_X_RANGE: Final = (-20.0, 23.0)
USUAL_HALF_WIDTH: Final = 20.0
"""mm, as the range along x; enough for targets of 15 mm in any direction."""

_STREAM: Final = 260_511
"""Sets the generator of the kind apart from that of its heights and gaps, of the same seed."""


@dataclass(frozen=True, kw_only=True)
class AnyGround(Terrain):
    """One of several kinds of ground, drawn for every episode.

    The ground of a seed is that of the same seed on the drawn kind's own terrain (`parts`), shifted
    so that every kind has its `base_height` at 0: episodes start alike on all of them.

    Attributes
    ----------
    kinds : terrains that are drawn from, each as likely as the others.
    height_range : of `blocks` and `mixed`, mm.
    gap_range : of `gapped` and `mixed`, mm.
    angle_range_deg : of `slope`, which rises in any direction.
    x_range : where the rough kinds have ground at least, mm; blocks take a box per 2 mm², and 1000
        boxes some 15 % more time. None: as far as the task leads (see `sized`), or -20 to 23 mm.
    half_width : of the rough kinds, to both sides, mm; None: as far as the task leads, or 20.
    """

    random: bool = True
    kinds: tuple[Kind, ...] = get_args(Kind)
    height_range: Annotated[tuple[float, float], Within(0, MAX_HEIGHT)] = RANDOM_HEIGHTS
    gap_range: Annotated[tuple[float, float], Within(0, MAX_GAP)] = RANDOM_GAPS
    angle_range_deg: Annotated[tuple[float, float], Within(0, 180)] = (0.0, 30.0)
    x_range: Annotated[tuple[float, float] | None, Within(-1000, 1000)] = None
    half_width: Annotated[float | None, Within(5, 1000)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.random:
            raise ValueError(
                "terrain.random: got False, but terrain 'any' draws a ground for every episode; "
                "allowed is True"
            )
        if not self.kinds:
            raise ValueError("terrain.kinds must name at least one, got none")
        distinct("terrain.kinds", self.kinds)
        for key in ("height_range", "gap_range", "angle_range_deg"):
            ordered(f"terrain.{key}", getattr(self, key))
        if self.x_range is not None:
            ordered("terrain.x_range", self.x_range)

    def sized(self, extent_mm: float | None) -> AnyGround:
        """Terrain as large as a task needs, up to where the hills end; see `Terrain.sized`."""
        x_range, half_width = self._size
        if extent_mm is not None and extent_mm > USUAL_HALF_WIDTH:
            edge = min(extent_mm, HILLS_EDGE)
            x_range, half_width = self.x_range or (-edge, edge), self.half_width or edge
        return replace(self, x_range=x_range, half_width=half_width)

    @property
    def _size(self) -> tuple[tuple[float, float], float]:
        return self.x_range or USUAL_X_RANGE, self.half_width or USUAL_HALF_WIDTH

    def kind(self, seed: int) -> Kind:
        """Kind of ground that goes with a ground's seed."""
        rng = np.random.default_rng([seed, _STREAM])
        return self.kinds[rng.integers(len(self.kinds))]

    @cached_property
    def parts(self) -> dict[Kind, Terrain]:
        """Terrains that are drawn from."""
        heights, gaps = self.height_range, self.gap_range
        x_range, half_width = self._size
        segments = self._segments_behind + math.ceil((x_range[1] - MIXED_START) / MIXED_SEGMENT)
        every: dict[Kind, Terrain] = {
            "flat": Flat(),
            "gapped": Gapped(gap_range=gaps, x_range=x_range, half_width=half_width),
            "blocks": Blocks(height_range=heights, x_range=x_range, half_width=half_width),
            "mixed": Mixed(
                height_range=heights, gap_range=gaps, segments=segments, half_width=half_width
            ),
            "hills": Hills(seed=self.seed, random=True),
            "slope": Slope(
                angle_range_deg=self.angle_range_deg, uphill_range_deg=(-180.0, 180.0), random=True
            ),
        }
        return {kind: every[kind] for kind in self.kinds}

    @property
    def _segments_behind(self) -> int:
        """Segments of mixed ground behind where it starts on its own."""
        start, _ = self._size[0]
        return max(0, math.ceil((MIXED_START - start) / MIXED_SEGMENT))

    def _offset(self, kind: Kind) -> tuple[float, float, float]:
        """From where a kind's own terrain lies to where it lies here, mm."""
        x = -MIXED_SEGMENT * self._segments_behind if kind == "mixed" else 0.0
        return x, 0.0, -self.parts[kind].base_height

    @cached_property
    def _hulls(self) -> dict[Kind, Boxes]:
        """Of the kinds that have boxes, where they lie here."""
        return {
            kind: part.hull().moved(self._offset(kind))
            for kind, part in self.parts.items()
            if isinstance(part, (Gapped, Blocks, Mixed))
        }

    @property
    def bounds(self) -> Bounds:
        """Where there is ground on every kind."""
        every = [(part.bounds, *self._offset(kind)) for kind, part in self.parts.items()]
        return Bounds(
            x_min=max(own.x_min + x for own, x, _, _ in every),
            x_max=min(own.x_max + x for own, x, _, _ in every),
            y_min=max(own.y_min for own, *_ in every),
            y_max=min(own.y_max for own, *_ in every),
            z_min=min(own.z_min + z for own, _, _, z in every),
            z_max=min(own.z_max + z for own, _, _, z in every),
        )

    @property
    def floor(self) -> float | None:
        """Height of the highest plane of a kind, mm; a ground says where its own lies."""
        floors = [
            part.floor - part.base_height for part in self.parts.values() if part.floor is not None
        ]
        return max(floors, default=None)

    @property
    def groups(self) -> tuple[slice, ...]:
        """Boxes of each kind that has some."""
        ends = np.cumsum([len(hull.centres) for hull in self._hulls.values()]).tolist()
        return tuple(map(slice, [0, *ends], ends))

    def hull(self) -> Boxes:
        """Boxes of all kinds; a ground has those of its own."""
        return joined(self._hulls.values())

    def heights(self) -> Heights | None:
        """Field of the hills; the other kinds have none of it."""
        return self.parts["hills"].heights() if "hills" in self.parts else None

    def draw(self, seed: int, difficulty: float = 1.0) -> Ground:
        """Draw a kind, and its ground; see `Terrain.draw`."""
        kind = self.kind(seed)
        part, offset = self.parts[kind], self._offset(kind)
        own = part.draw(seed, difficulty)
        return Ground(
            own.boxes.moved(offset),
            own.shift if part.heights() is not None else None,
            own.down,
            None if own.floor is None else own.floor + offset[2],
            [*self._hulls].index(kind) if kind in self._hulls else None,
        )

    def compiled(self) -> Ground:
        """Ground that a scene is compiled with: all that there is in any, and not at the origin."""
        usual = Ground() if "hills" not in self.parts else self.parts["hills"].draw(self.seed)
        floor = None if self.floor is None else self.floor - 1e-6
        return replace(usual, boxes=off_origin(self.hull()), floor=floor)
