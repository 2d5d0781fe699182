"""Ground to walk on."""

from flyrl.terrains.terrain import (
    FLAT_GROUND,
    SPAWN_CLEARANCE,
    TERRAIN_NAMES,
    TERRAINS,
    Bounds,
    Boxes,
    TerrainConfig,
    TerrainName,
    add_terrain,
    base_height,
    box_colours,
    draw_ground,
    terrain_bounds,
    terrain_boxes,
    terrain_label,
)

__all__ = [
    "FLAT_GROUND",
    "SPAWN_CLEARANCE",
    "TERRAINS",
    "TERRAIN_NAMES",
    "Bounds",
    "Boxes",
    "TerrainConfig",
    "TerrainName",
    "add_terrain",
    "base_height",
    "box_colours",
    "draw_ground",
    "terrain_bounds",
    "terrain_boxes",
    "terrain_label",
]
