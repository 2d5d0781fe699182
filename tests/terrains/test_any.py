"""Ground of any kind: each drawn ground is walked on as on the terrain of its kind alone."""

import dataclasses

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.report.paths import ground_picture
from flyrl.simulation.rendering import FlyRenderer
from flyrl.tasks import TASKS
from flyrl.terrains import AnyGround, Bounds, Gapped
from tests.pictures import drawing

ANY = AnyGround()
HALF = Bounds(-10.0, 10.0, -10.0, 10.0)
FLIES = 2


def seeds_of(kind, number=FLIES):
    """Seeds of episodes whose ground is of a kind."""
    return [seed for seed in range(100) if ANY.kind(2**32 + seed) == kind][:number]


@pytest.fixture(scope="module")
def env():
    return BatchedEnv(EnvConfig("target", terrain=ANY), FLIES, 1)


def test_kinds_are_equally_likely():
    kinds, counts = np.unique([ANY.kind(seed) for seed in range(1200)], return_counts=True)
    assert set(kinds) == set(ANY.kinds)
    # six standard deviations about 200
    assert (abs(counts - 200) < 80).all()


@pytest.mark.parametrize("kind", ANY.kinds)
def test_a_ground_is_that_of_its_kinds_own_terrain(kind):
    (seed,) = seeds_of(kind, 1)
    own, ground = (each.draw(seed + 2**32, 0.7) for each in (ANY.parts[kind], ANY))
    height = ANY.parts[kind].base_height
    np.testing.assert_array_equal(own.boxes.half_sizes, ground.boxes.half_sizes)
    np.testing.assert_allclose(own.boxes.tops - height, ground.boxes.tops, atol=1e-12)
    assert own.down == ground.down
    assert ground.shift == (own.shift if kind == "hills" else None)


# of gaps and blocks, the height above the world's origin is another, and so is what is rounded
@pytest.mark.parametrize(
    ("kind", "tolerance"),
    [("flat", 0), ("slope", 0), ("hills", 0), ("gapped", 1e-8), ("blocks", 1e-8)],
)
def test_a_fly_walks_as_on_the_terrain_of_its_kind(env, kind, tolerance):
    env.reset(seeds=seeds_of(kind))
    part = ANY.parts[kind]
    if kind in ("gapped", "blocks"):
        part = dataclasses.replace(part, random=True)
    alone = BatchedEnv(EnvConfig("target", terrain=part), FLIES, 1)
    episodes = []
    for episode in env.episodes:
        raised = np.add(episode.spawn_position_w, (0.0, 0.0, part.base_height))
        ground = episode.ground_seed if part.random else None
        episodes.append(dataclasses.replace(episode, spawn_position_w=raised, ground=ground))
    alone.reset(episodes=episodes)
    for _ in range(4):
        for each in (env, alone):
            each.step(np.tile((1.0, 0.6), (FLIES, 1)))
    expected = alone.state.position_w - (0.0, 0.0, part.base_height)
    np.testing.assert_allclose(env.state.position_w, expected, rtol=0, atol=tolerance)


def test_after_another_kind_a_ground_is_what_it_was(env):
    def walked():
        env.reset(seeds=seeds_of("mixed"))
        env.step(np.ones((FLIES, 2)))
        return env.flies.integration_state()

    first = walked()
    env.reset(seeds=[seeds_of("hills")[0], seeds_of("flat")[0]])
    np.testing.assert_array_equal(walked(), first)


def test_targets_lie_all_around_on_every_kind():
    bounds = ANY.bounds
    assert (bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max) == (-20, 23, -20, 20)
    goals = [TASKS["target"]().sample_episode(ANY, seed).goal for seed in range(300)]
    assert (np.min(goals, axis=0) < -13).all()
    assert (np.max(goals, axis=0) > 13).all()
    for kind in ("gapped", "blocks", "mixed"):
        boxes = dataclasses.replace(ANY, kinds=(kind,)).hull()
        assert (boxes.centres - boxes.half_sizes)[:, 0].min() <= -20
        # a gap may end it
        assert (boxes.centres + boxes.half_sizes)[:, 0].max() >= 23 - 1.3, kind


@pytest.mark.parametrize(
    ("settings", "extent_mm", "size"),
    [
        ({}, None, ((-20, 23), 20)),
        ({}, 15.0, ((-20, 23), 20)),
        ({}, 30.0, ((-30, 30), 30)),
        # where the hills end
        ({}, 80.0, ((-50, 50), 50)),
        ({"x_range": (-8, 9)}, 30.0, ((-8, 9), 30)),
        ({"half_width": 70.0}, 30.0, ((-30, 30), 70)),
    ],
)
def test_it_is_as_large_as_the_task_leads_where_nothing_else_is_set(settings, extent_mm, size):
    terrain = AnyGround(**settings).sized(extent_mm)
    assert (terrain.x_range, terrain.half_width) == size


def test_a_fly_cannot_walk_out_of_it_within_the_time_of_heading():
    bounds = EnvConfig({"name": "heading", "time_limit": 3.0}, terrain="any").scene.terrain.bounds
    assert (bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max) == (-39, 39, -39, 39)


def test_the_fastest_command_of_velocity_does_not_lead_out_of_it():
    env = EnvConfig({"name": "velocity", "speed": (-10, 4), "time_limit": 3.0}, terrain="any")
    assert env.scene.terrain.bounds.x_max == 30


@pytest.mark.parametrize(("kind", "bare"), [("flat", 0.0), ("gapped", 0.2), ("hills", 0.0)])
def test_the_map_shows_the_ground_that_was_drawn(kind, bare):
    picture = ground_picture(ANY, ANY.draw(seeds_of(kind, 1)[0] + 2**32), HALF)
    # gaps are bare: 0.1-0.45 mm of each 1.3 mm
    assert (picture[..., 3] == 0).mean() == pytest.approx(bare, abs=0.05)
    assert (len(np.unique(picture[..., 3])) > 2) == (kind == "hills")


def test_a_picture_shows_the_drawn_ground(env):
    env.reset(seeds=[seeds_of("blocks")[0], seeds_of("flat")[0]])
    with drawing():
        renderer = FlyRenderer(env.config.scene, 160, 120)
    renderer.render(env.flies, 0)
    renderer.render(env.flies, 1)
    model, data = renderer._model, renderer._data
    from_above = np.array([6.0, 6.0, 50.0])
    for sim, kind in ((1, "flat"), (0, "blocks")):
        renderer.render(env.flies, sim)
        distance = mujoco.mj_ray(model, data, from_above, np.array([0.0, 0, -1]), None, 1, -1, None)
        ground = env.flies.ground(sim)
        assert 50 - distance == pytest.approx(ANY.top_at(ground, 6.0, 6.0), abs=1e-6), kind
    renderer.close()


def test_a_slab_that_is_compiled_by_a_rounding_error_beside_the_origin_is_moved():
    # -20 + 0.5 + 15 * 1.3 is 0 but for rounding
    boxes = Gapped(gap_range=(0.1, 0.4), x_range=(-20, 23), random=True).compiled().boxes
    assert np.abs(boxes.centres).max(axis=1).min() >= 1e-7


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"random": False}, r"terrain\.random: got False, but terrain 'any' draws"),
        ({"kinds": ()}, r"terrain\.kinds must name at least one"),
        ({"kinds": ("flat", "flat")}, r"terrain\.kinds"),
        ({"kinds": ("stairs",)}, r"terrain\.kinds.* must be one of 'flat'"),
        ({"gap_range": (0.4, 0.1)}, r"terrain\.gap_range"),
    ],
)
def test_what_is_not_allowed_is_named(settings, message):
    with pytest.raises(ValueError, match=message):
        AnyGround(**settings)
