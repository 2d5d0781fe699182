"""The door: a terrain of a user's own, by its name."""

import dataclasses
import sys
import textwrap

import numpy as np
import pytest

import flyrl
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.terrains import (
    KINDS,
    TERRAINS,
    Bounds,
    Boxes,
    Gapped,
    Terrain,
    terrain_from,
    terrain_label,
    terrain_named,
    terrain_on_record,
)

STEPS = Boxes(
    centres=np.array([[0.0, 0.0, -0.5], [2.0, 0.0, -0.3]]),
    half_sizes=np.array([[0.5, 1.0, 0.5], [0.5, 1.0, 0.5]]),
)
"""Two boxes, 0 and 0.2 mm high, with a gap from x = 0.5 to 1.5."""


@dataclasses.dataclass(frozen=True)
class Steps(Terrain):
    """Two boxes."""

    def boxes(self, rng, difficulty):
        return STEPS


@pytest.mark.parametrize(("x", "top"), [(0.0, 0.0), (2.4, 0.2), (1.0, None)])
def test_the_ground_at_a_place_is_the_top_of_its_box(x, top):
    found = Steps().top_at(Steps().draw(0), x, 0.3)
    assert found == (None if top is None else pytest.approx(top))


def test_labels_are_the_names():
    assert [terrain.label for terrain in TERRAINS.values()] == list(TERRAINS)
    assert terrain_label("my_lab:Stairs", True) == "random_Stairs"


@pytest.mark.parametrize(
    ("record", "terrain"),
    [
        *((dataclasses.asdict(TERRAINS[name]), TERRAINS[name]) for name in KINDS),
        (
            {"name": "random_blocks", "seed": 3},
            dataclasses.replace(TERRAINS["random_blocks"], seed=3),
        ),
        # records of 0.1 held the settings of all terrains
        (
            {"name": "gapped", "seed": 3, "height_range": [0.35, 0.35], "gap_range": [0.1, 0.2]},
            Gapped(seed=3, gap_range=(0.1, 0.2)),
        ),
    ],
)
def test_what_is_on_record_makes_the_same_terrain(record, terrain):
    assert terrain_from(record) == terrain


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ({}, "terrain.name must be text, got None"),
        ({"name": "gaped"}, "terrain.name must be one of .* did you mean 'gapped'"),
        (
            {"name": "blocks", "heigth_range": [0, 1]},
            "no 'heigth_range'; did you mean 'height_range'",
        ),
    ],
)
def test_a_bad_record_is_explained(record, message):
    with pytest.raises(ValueError, match=message):
        terrain_from(record)


@pytest.fixture
def my_ground(own_module):
    """A module of a user's own, in the current folder."""
    code = """
        from dataclasses import dataclass
        import numpy as np
        from flyrl.terrains import Bounds, Boxes, Terrain

        @dataclass(frozen=True)
        class Ridge(Terrain):
            height: float = 0.2
            bounds = Bounds(-10, 10, -10, 10)

            def boxes(self, rng, difficulty):
                height = difficulty * self.height * rng.uniform(0.5, 1.0)
                half_size = (0.5, 10.0, height / 2)
                return Boxes(np.array([[3.0, 0.0, height / 2]]), np.array([half_size]))

        @dataclass(frozen=True)
        class RandomRidge(Ridge):
            def hull(self):
                return Boxes(np.array([[3.0, 0.0, 0.05]]), np.array([[0.5, 10.0, 0.05]]))
    """
    own_module("my_ground", textwrap.dedent(code))
    return "my_ground:Ridge"


def test_a_terrain_of_ones_own_is_walked_on(my_ground):
    walk = flyrl.walk(terrain={"name": my_ground, "height": 0.1}, seconds=0.05)
    assert walk.outcome == "running"
    assert walk.env.batch.scene.model.geom("ground_0").size[2] <= 0.05


def test_a_record_makes_no_terrain_of_code_that_is_not_loaded(my_ground):
    assert terrain_on_record({"name": my_ground}) is None
    assert "my_ground" not in sys.modules
    terrain = terrain_named(my_ground)
    assert terrain_on_record({"name": my_ground}) == terrain
    assert terrain.bounds == Bounds(-10, 10, -10, 10)


def test_ground_that_differs_needs_a_hull(my_ground):
    with pytest.raises(ValueError, match=r"my_ground:Ridge must define hull\(\)"):
        BatchedEnv(EnvConfig("hybrid_turning", terrain={"name": my_ground, "random": True}), 1, 1)


def test_a_box_beyond_its_hull_is_refused(my_ground):
    terrain = {"name": "my_ground:RandomRidge", "height": 1.0, "random": True}
    env = BatchedEnv(EnvConfig("hybrid_turning", terrain=terrain), 1, 1)
    with pytest.raises(ValueError, match=r"box 0 .* mm beyond that of the terrain's hull\(\)"):
        env.reset(seeds=[0])


def test_what_is_no_terrain_is_refused(my_ground):
    with pytest.raises(ValueError, match="my_ground:np must be a Terrain, got a module"):
        terrain_named("my_ground:np")
