import math

import mujoco
import numpy as np
import pytest

from flyrl.terrains import (
    KINDS,
    SPAWN_CLEARANCE,
    TERRAINS,
    Blocks,
    Gapped,
    Mixed,
    add_terrain,
    box_colours,
)


def compiled(config):
    spec = mujoco.MjSpec()
    add_terrain(spec, config)
    return spec.compile()


def surface(model, x, y):
    """Height of the ground at (x, y), by a ray from above."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    distance = mujoco.mj_ray(
        model, data, np.array([x, y, 10.0]), np.array([0.0, 0, -1]), None, 1, -1, None
    )
    return 10.0 - distance


# x -> height. First slab -10 … -9, gap … -8.7, second slab … -7.7; the 8th starts at
# -10 + 7 * 1.3 = -0.9 and ends at 0.1
GAPPED = {
    -9.99: 1, -9.01: 1, -8.99: -1, -8.71: -1, -8.69: 1, 0.09: 1, 0.11: -1,
}  # fmt: skip
# Three columns of blocks, lowered by 0.1 + 0.35: high, low, high. Half a slab from 3.9, gap from
# 4.4, slab from 4.7, gap from 5.7, flat from 6.0 to 9.0
MIXED = {
    0.65: 0, 1.95: -0.35, 3.25: 0, 4.39: 0, 4.41: -1, 4.69: -1, 4.71: 0, 5.69: 0, 5.71: -1,
    5.99: -1, 6.01: 0, 8.9: 0,
}  # fmt: skip
FIRST_ROW = -20 + 0.65
# in each row, and a column of blocks in y; high ones at the corner reach 0.065 over -8.7
BLOCKS = {
    -9.35: 0.45, -8.05: 0.1, -6.75: 0.45, -8.7 + 0.06: 0.45, -8.7 + 0.07: 0.1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("terrain", "y", "heights"),
    [
        (Gapped(), 0.1, GAPPED),
        (Mixed(), FIRST_ROW, {s + x: z for s in (-4.0, 5.0, 14.0) for x, z in MIXED.items()}),
        (Blocks(), FIRST_ROW, BLOCKS),
        (Blocks(), FIRST_ROW + 1.3, {-9.35: 0.1, -8.05: 0.45, -6.75: 0.1}),
        (Blocks(), FIRST_ROW + 2.6, {-9.35: 0.45, -8.05: 0.1, -6.75: 0.45}),
    ],
)
def test_the_ground_along_a_line(terrain, y, heights):
    model = compiled(terrain)
    found = [surface(model, x, y) for x in heights]
    np.testing.assert_allclose(found, list(heights.values()), atol=1e-9)


def test_gapped_slabs_are_27_and_2_mm_deep():
    boxes = Gapped().compiled().boxes
    np.testing.assert_allclose(boxes.half_sizes, [[0.5, 20, 1]] * 27)
    np.testing.assert_allclose(boxes.centres[:, 2], 0, atol=1e-12)


def test_low_blocks_cover_what_single_ones_would():
    """27 columns of 31; every other one is high, and the low ones are one box."""
    boxes = Blocks().compiled().boxes
    assert len(boxes.centres) == 1 + math.ceil(27 * 31 / 2)
    np.testing.assert_allclose(boxes.half_sizes[1:, :2], 1.3 * 1.1 / 2)
    low_corner = (boxes.centres - boxes.half_sizes)[0]
    high_corner = (boxes.centres + boxes.half_sizes)[0]
    np.testing.assert_allclose(low_corner, [-10 - 0.065, -20 - 0.065, -1.3])
    np.testing.assert_allclose(
        high_corner, [-10 + 27 * 1.3 + 0.065, -20 + 31 * 1.3 + 0.065, 0.1], atol=1e-12
    )


# ------------------------------------------------------------------ random


def slabs(name, boxes):
    """Where the slabs start and end in x, of the 27 of "gapped" or the 3 in a "mixed" segment."""
    chosen = slice(None) if name == "gapped" else slice(48, 51)
    x, half_size = boxes.centres[chosen, 0], boxes.half_sizes[chosen, 0]
    return x - half_size, x + half_size


def test_random_heights_are_drawn_block_by_block_from_the_seed():
    """And level blocks are darker than the higher ones."""
    boxes = Blocks(seed=3, height_range=(0.15, 0.45)).compiled().boxes
    rng = np.random.default_rng(3)
    np.testing.assert_allclose(boxes.tops[1:6], [0.1 + rng.uniform(0.15, 0.45) for _ in range(5)])
    colours = box_colours(boxes)[np.argsort(boxes.tops)]
    assert np.all(np.diff(colours[:, :3].sum(axis=1)) > 0)
    np.testing.assert_array_equal(colours[:, 3], 1.0)


def test_random_gaps_keep_their_middles():
    starts, ends = slabs("gapped", Gapped(seed=3, gap_range=(0.05, 0.6)).compiled().boxes)
    widths = np.random.default_rng(3).uniform(0.05, 0.6, size=26)
    np.testing.assert_allclose(starts[1:] - ends[:-1], widths)
    np.testing.assert_allclose((starts[1:] + ends[:-1]) / 2, -8.85 + 1.3 * np.arange(26))
    # the ground starts and ends where it does with even gaps
    np.testing.assert_allclose([starts[0], ends[-1]], [-10, 24.8])


@pytest.mark.parametrize("difficulty", [1.0, 0.5])
def test_mixed_ground_draws_gaps_after_heights_and_scales_both(difficulty):
    mixed = Mixed(height_range=(0.1, 0.5), gap_range=(0.05, 0.6), random=True)
    boxes = mixed.draw(7, difficulty).boxes
    starts, ends = slabs("mixed", boxes)
    rng = np.random.default_rng(7)
    heights = difficulty * rng.uniform(0.1, 0.5, size=3 * 47)
    widths = difficulty * rng.uniform(0.05, 0.6, size=6)[:2]
    # lowered by the mean height, from blocks of 0.1 mm
    low = -0.3 * difficulty
    np.testing.assert_allclose(boxes.tops[:48], [low, *heights[:47] + low], atol=1e-12)
    np.testing.assert_allclose(starts[1:] - ends[:-1], widths)
    np.testing.assert_allclose((starts[1:] + ends[:-1]) / 2, [0.55, 1.85])
    np.testing.assert_allclose([starts[0], ends[-1]], [-0.1, 5.0], atol=1e-12)


@pytest.mark.parametrize("name", ["gapped", "blocks", "mixed"])
def test_without_difficulty_the_ground_is_level(name):
    config = TERRAINS[f"random_{name}"]
    ground = config.draw(7, difficulty=0.0).boxes
    np.testing.assert_allclose(ground.tops, config.base_height, atol=1e-12)
    if name != "blocks":
        starts, ends = slabs(name, ground)
        np.testing.assert_allclose(starts[1:], ends[:-1], atol=1e-12)


# ------------------------------------------------------------------ all


@pytest.mark.parametrize("name", [name for name in KINDS if name != "air"])
def test_ground_geoms_are_slippery_and_touchable_as_specified(name):
    model = compiled(TERRAINS[name])
    assert all(model.geom(index).name.startswith("ground") for index in range(model.ngeom))
    np.testing.assert_array_equal(model.geom_friction, [[1, 0.005, 0.0001]] * model.ngeom)
    is_plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_array_equal(model.geom_contype, np.where(is_plane, 1, 2))
    assert set(model.geom_conaffinity) == {0}
    assert set(model.geom_group) == {0}


@pytest.mark.parametrize(
    ("terrain", "base", "expected"),
    [
        (Gapped(x_range=(-30, 40), half_width=30), 1.0, (-30, 40, -30, 30)),
        (Blocks(), 0.1, (-10, 25, -20, 20)),
        (Mixed(segments=5), 0.0, (-4, 41, -20, 20)),
    ],
)
def test_bounds_and_heights_where_flies_start(terrain, base, expected):
    bounds = terrain.bounds
    assert (bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max) == expected
    assert terrain.base_height == base
    assert SPAWN_CLEARANCE == 0.5


@pytest.mark.parametrize(
    ("terrain", "x"),
    [(Blocks(x_range=(-30, 40)), (-29, 39)), (Mixed(segments=5), (-3, 40))],
)
def test_larger_ground_is_there_to_its_ends(terrain, x):
    model = compiled(terrain)
    assert min(surface(model, each, 0.0) for each in x) > -0.5


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (Blocks, {"height_range": (0.4, 0.2)}, r"height_range must .* got \(0.4, 0.2\)"),
        (Gapped, {"x_range": (5.0, 4.0)}, r"x_range must be \(least, greatest\), got \(5.0, 4.0\)"),
    ],
)
def test_bad_settings_are_named(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(**arguments)


def test_difficulty_is_a_share():
    with pytest.raises(ValueError, match=r"difficulty must lie within 0 and 1, got 1\.1"):
        TERRAINS["random_blocks"].draw(0, 1.1)
