"""Pictures of worms, where something can draw them."""

import numpy as np
import pytest
from test_worms import CRAWLING, HANGING, make_batch

from flyrl.bodies.worm import CRAWLER
from flyrl.simulation.rendering import RenderingUnavailableError, WormRenderer
from flyrl.simulation.scene import SceneConfig

WIDTH, HEIGHT = 96, 64


def drawn(batch, camera="follow"):
    try:
        renderer = WormRenderer(batch.scene.config, WIDTH, HEIGHT, camera)
    except RenderingUnavailableError as error:
        pytest.skip(str(error))
    picture = renderer.render(batch, 0)
    renderer.close()
    return picture.astype(int)


def redness(picture):
    return picture[..., 0] - picture[..., 1]


@pytest.mark.parametrize("scene", [CRAWLING, HANGING], ids=["crawling", "hanging"])
@pytest.mark.parametrize("camera", ["follow", "top"])
def test_the_worm_is_in_the_middle_third_and_all_of_it_in_the_picture(scene, camera):
    """The only red thing; a crawling worm lies 60 mm off the middle of the ground."""
    batch = make_batch(scene)
    if scene is CRAWLING:
        batch.reset(np.array([0]), [[60.0, 0.0]], np.ones(1), np.zeros((1, 5)))
    is_worm = redness(drawn(batch, camera)) > 30
    rows, columns = np.nonzero(is_worm)
    assert HEIGHT / 3 < rows.mean() < 2 * HEIGHT / 3
    assert WIDTH / 3 < columns.mean() < 2 * WIDTH / 3
    assert rows.min() > 0
    assert rows.max() < HEIGHT - 1
    assert columns.min() > 0
    assert columns.max() < WIDTH - 1


def test_a_camera_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="camera must be one of 'follow', 'top', got 'goal'"):
        WormRenderer(SceneConfig(CRAWLER), camera="goal")
