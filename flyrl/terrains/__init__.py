"""Ground to walk on."""

from typing import Final

from flyrl.terrains.any import AnyGround
from flyrl.terrains.geoms import (
    NOWHERE,
    TARGET_MARKER,
    Prop,
    add_prop,
    add_terrain,
    box_colours,
)
from flyrl.terrains.rough import RANDOM_GAPS, RANDOM_HEIGHTS, Blocks, Gapped, Mixed
from flyrl.terrains.smooth import Air, Ball, Flat, Hills, Slope
from flyrl.terrains.terrain import (
    KINDS,
    SPAWN_CLEARANCE,
    TERRAINS,
    Bounds,
    Boxes,
    Ground,
    Heights,
    Terrain,
    terrain_from,
    terrain_label,
    terrain_named,
    terrain_on_record,
)

KINDS.update(
    flat=Flat,
    gapped=Gapped,
    blocks=Blocks,
    mixed=Mixed,
    hills=Hills,
    slope=Slope,
    air=Air,
    ball=Ball,
    any=AnyGround,
)

LITERATURE: Final = ("flat", "gapped", "blocks", "mixed")
"""Terrains that flies of the literature walked on."""

TERRAINS.update(
    {name: kind() for name, kind in KINDS.items()},
    random_gapped=Gapped(gap_range=RANDOM_GAPS, random=True),
    random_blocks=Blocks(height_range=RANDOM_HEIGHTS, random=True),
    random_mixed=Mixed(height_range=RANDOM_HEIGHTS, gap_range=RANDOM_GAPS, random=True),
    random_hills=Hills(random=True),
)

__all__ = [
    "KINDS",
    "LITERATURE",
    "NOWHERE",
    "SPAWN_CLEARANCE",
    "TARGET_MARKER",
    "TERRAINS",
    "Air",
    "AnyGround",
    "Ball",
    "Blocks",
    "Bounds",
    "Boxes",
    "Flat",
    "Gapped",
    "Ground",
    "Heights",
    "Hills",
    "Mixed",
    "Prop",
    "Slope",
    "Terrain",
    "add_prop",
    "add_terrain",
    "box_colours",
    "terrain_from",
    "terrain_label",
    "terrain_named",
    "terrain_on_record",
]
