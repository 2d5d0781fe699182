import numpy as np
import pytest

from flyrl.terrains import Heights, Hills
from tests.terrains.test_rough import compiled, surface


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
