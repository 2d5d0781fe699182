import math

import mujoco
import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.terrains import Air, Flat, Heights, Hills, Mixed, Slope
from tests.terrains.test_rough import compiled, surface


def test_flat_is_one_plane_at_zero_chequered_in_squares_of_a_millimetre():
    model = compiled(Flat())
    assert model.geom_type.tolist() == [mujoco.mjtGeom.mjGEOM_PLANE]
    np.testing.assert_array_equal(model.geom_pos, 0)
    # A picture of 2 x 2 squares; MuJoCo lays half as many pictures per mm as it is told.
    material = model.mat(model.geom_matid[0])
    assert (material.texuniform, *material.texrepeat) == (1, 1.0, 1.0)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Flat, r"terrain\.random: got True, but flat has nothing to draw"),
        (Air, "but air has nothing to draw"),
        (Slope, "angle_range_deg or uphill_range_deg is a single value"),
        (Mixed, "height_range or gap_range is a single value"),
    ],
)
def test_ground_of_which_nothing_is_drawn_is_not_random(kind, message):
    with pytest.raises(ValueError, match=message):
        kind(random=True)


@pytest.mark.parametrize(
    ("angle", "uphill", "difficulty", "down"),
    [
        (30, 0, 1.0, (-0.5, 0.0, -math.sqrt(0.75))),
        (90, 90, 1.0, (0.0, -1.0, 0.0)),
        (60, 0, 0.5, (-0.5, 0.0, -math.sqrt(0.75))),
    ],
)
def test_things_fall_down_the_slope(angle, uphill, difficulty, down):
    slope = Slope(angle_range_deg=(angle, angle), uphill_range_deg=(uphill, uphill))
    np.testing.assert_allclose(slope.draw(0, difficulty).down, down, atol=1e-12)


def test_random_slopes_are_drawn_from_their_range():
    slope = Slope(angle_range_deg=(10, 50), random=True)
    angles = [math.degrees(math.acos(-slope.draw(seed).down[2])) for seed in range(50)]
    assert 10 <= min(angles) < 15
    assert 45 < max(angles) <= 50


def walked(terrain, drive=1.0):
    """Outcomes of four flies during 0.5 s, and how far they come, mm, (4,) each."""
    env = BatchedEnv(EnvConfig("hybrid_turning", terrain=terrain, decision_interval=0.02), 4, 1)
    env.reset(seeds=range(4))
    start = env.state.position_w
    outcomes = [env.step(np.full((4, 2), drive)).outcome for _ in range(25)]
    return np.transpose(outcomes), env.state.position_w - start


@pytest.mark.parametrize(("angle", "falls"), [(30.0, False), (120.0, True)])
def test_a_fly_walks_up_a_slope_and_falls_off_an_overhang(angle, falls):
    outcomes, moved = walked(Slope(angle_range_deg=(angle, angle)))
    assert ((outcomes == "fall").any(axis=1) == falls).all()
    assert falls or (moved[:, 0] > 3.0).all()


def test_a_fly_walks_over_hills():
    for drive, low, high in ((1.0, 5.0, np.inf), (0.0, 0.0, 1.0)):
        outcomes, moved = walked("random_hills", drive)
        assert (outcomes == "running").all()
        assert low < np.median(np.linalg.norm(moved[:, :2], axis=1)) < high


def test_every_fly_has_a_slope_of_its_own():
    """To the bit that of a scene that is compiled with it, down which gravity pulls."""

    def made(num_envs, **settings):
        terrain = Slope(angle_range_deg=(0, 60), **settings)
        return BatchedEnv(EnvConfig("hybrid_turning", terrain=terrain), num_envs, 1)

    both = made(2, random=True)
    both.reset(seeds=[4, 5])
    episodes = [*both.episodes]
    both.step(np.ones((2, 2)))
    for expected, episode in zip(both.flies.integration_state(), episodes, strict=True):
        single = made(1, seed=episode.ground_seed)
        down = both.config.scene.terrain.draw(episode.ground_seed).down
        np.testing.assert_allclose(single.batch.scene.model.opt.gravity, 9810 * np.array(down))
        single.reset(episodes=[episode])
        single.step(np.ones((1, 2)))
        np.testing.assert_array_equal(single.flies.integration_state()[0], expected)


def test_a_slope_pulls_to_the_bit_as_before_after_many_others():
    terrain = Slope(angle_range_deg=(0, 60), random=True)
    env = BatchedEnv(EnvConfig("hybrid_turning", terrain=terrain), 1, 1)

    def stepped(seed):
        env.reset(seeds=[seed])
        env.step(np.ones((1, 2)))
        return env.flies.integration_state().copy()

    first = stepped(4)
    for seed in range(300):
        env.reset(seeds=[seed])
    np.testing.assert_array_equal(stepped(4), first)


# ------------------------------------------------------------------ hills


def test_heights_between_corners_are_those_of_a_bilinear_patch():
    heights = Heights(np.array([[0.0, 1.0], [2.0, 5.0]]), cell=2.0)
    assert heights.half_extent == (1.0, 1.0)
    # rows along y, columns along x
    assert heights.at(-1.0, -1.0) == 0.0
    assert heights.at(1.0, -1.0) == 1.0
    assert heights.at(-1.0, 1.0) == 2.0
    assert heights.at(0.0, 0.0) == pytest.approx((0 + 1 + 2 + 5) / 4)
    assert heights.at(9.0, 9.0) == 5.0  # beyond the edge


@pytest.mark.parametrize("hills", [Hills(), Hills(height=1.5, width=5, seed=2)])
def test_hills_are_as_high_as_they_are_told(hills):
    values = hills.heights().values
    assert (values.min(), np.ptp(values)) == pytest.approx((0.0, hills.height))


def test_what_mujoco_has_is_the_field():
    hills = Hills()
    model, ground = compiled(hills), hills.draw(hills.seed)
    for x, y in np.random.default_rng(0).uniform(-40, 40, size=(20, 2)):
        # MuJoCo's triangles differ from the bilinear patch by little
        assert surface(model, x, y) == pytest.approx(hills.top_at(ground, x, y), abs=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_no_ground_where_flies_start_is_above_the_base_height(seed):
    hills = Hills(random=True)
    ground = hills.draw(seed)
    near = np.random.default_rng(seed).uniform(-4, 4, size=(300, 2))
    tops = [hills.top_at(ground, x, y) for x, y in near]
    assert -hills.height < min(tops) < max(tops) < 0.05


def test_random_hills_are_other_parts_of_the_same_field():
    hills = Hills(random=True)
    assert hills.draw(0).shift[:2] != hills.draw(1).shift[:2]
    assert Hills().draw(0).shift[:2] == (0.0, 0.0)
