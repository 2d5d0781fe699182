"""Ground to walk on."""

from flyrl.terrains.terrain import (
    SPAWN_CLEARANCE,
    TERRAIN_NAMES,
    Bounds,
    Boxes,
    TerrainConfig,
    TerrainName,
    add_terrain,
    base_height,
    terrain_bounds,
    terrain_boxes,
)

__all__ = [
    "SPAWN_CLEARANCE",
    "TERRAIN_NAMES",
    "Bounds",
    "Boxes",
    "TerrainConfig",
    "TerrainName",
    "add_terrain",
    "base_height",
    "terrain_bounds",
    "terrain_boxes",
]
