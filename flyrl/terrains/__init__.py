"""Ground to walk on."""

from typing import Final

from flyrl.terrains.any import AnyGround as AnyGround
from flyrl.terrains.geoms import NOWHERE as NOWHERE
from flyrl.terrains.geoms import TARGET_MARKER as TARGET_MARKER
from flyrl.terrains.geoms import Prop as Prop
from flyrl.terrains.geoms import add_prop as add_prop
from flyrl.terrains.geoms import add_terrain as add_terrain
from flyrl.terrains.geoms import box_colours as box_colours
from flyrl.terrains.rough import RANDOM_GAPS, RANDOM_HEIGHTS
from flyrl.terrains.rough import Blocks as Blocks
from flyrl.terrains.rough import Gapped as Gapped
from flyrl.terrains.rough import Mixed as Mixed
from flyrl.terrains.smooth import Air as Air
from flyrl.terrains.smooth import Ball as Ball
from flyrl.terrains.smooth import Flat as Flat
from flyrl.terrains.smooth import Hills as Hills
from flyrl.terrains.smooth import Slope as Slope
from flyrl.terrains.terrain import KINDS as KINDS
from flyrl.terrains.terrain import SPAWN_CLEARANCE as SPAWN_CLEARANCE
from flyrl.terrains.terrain import TERRAINS as TERRAINS
from flyrl.terrains.terrain import Bounds as Bounds
from flyrl.terrains.terrain import Boxes as Boxes
from flyrl.terrains.terrain import Ground as Ground
from flyrl.terrains.terrain import Heights as Heights
from flyrl.terrains.terrain import Terrain as Terrain
from flyrl.terrains.terrain import terrain_from as terrain_from
from flyrl.terrains.terrain import terrain_label as terrain_label
from flyrl.terrains.terrain import terrain_named as terrain_named
from flyrl.terrains.terrain import terrain_on_record as terrain_on_record

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
