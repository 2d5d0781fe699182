"""Where things are in pictures: by hand, and where something can draw, in a picture."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from test_worms import CRAWLING, HANGING, make_batch

from flyrl.bodies.worm import CRAWLER
from flyrl.simulation.rendering import (
    FlyRenderer,
    WormRenderer,
    can_draw_in_threads,
)
from flyrl.simulation.scene import SceneConfig
from flyrl.tasks import Episode
from flyrl.terrains import TARGET_MARKER
from tests.pictures import drawing
from tests.simulation.test_callback import make_batch as make_flies


@pytest.mark.parametrize(
    ("library", "expected"),
    [("mujoco.glfw", False), ("mujoco.egl", True), ("mujoco.osmesa", True)],
)
def test_windows_alone_are_drawn_in_one_thread(monkeypatch, library, expected):
    monkeypatch.setenv("DISPLAY", ":0")
    context = type("GLContext", (), {"__module__": library})
    monkeypatch.setattr(mujoco, "GLContext", context, raising=False)
    assert can_draw_in_threads() is expected


def test_a_camera_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="camera must be one of 'follow', 'top', 'goal'"):
        FlyRenderer(SceneConfig(), camera="side")
    with pytest.raises(ValueError, match="camera must be one of 'follow', 'top', got 'goal'"):
        WormRenderer(SceneConfig(CRAWLER), camera="goal")


def test_the_target_seen_from_above_is_as_wide_as_the_scale_says():
    """Its disc of 2 mm lies some 1.3 mm below the thorax, so that it is drawn a little smaller."""
    flies = make_flies(props=(TARGET_MARKER,))
    flies.set_props(np.array([0]), np.array([[[2.5, 0.0, 0.02]]]))
    with drawing():
        renderer = FlyRenderer(flies.scene.config, 320, 240, "top", distance=10.0)
    picture = renderer.render(flies, 0, (2.5, 0.0)).astype(int)
    renderer.close()
    assert renderer.pixels_per_mm == pytest.approx(240 / (2 * 0.414214 * 10.0), rel=1e-4)
    is_red = picture[..., 0] - picture[..., 1] > 80
    rows, _ = np.nonzero(is_red[:, 190:])
    below = flies.state().position_w[0, 2]
    expected = 2.0 * renderer.pixels_per_mm * 10.0 / (10.0 + below)
    assert np.ptp(rows) + 1 == pytest.approx(expected, abs=3)
    # the scale of another depth would be off by more than that
    assert abs(2.0 * renderer.pixels_per_mm - expected) > 4


@pytest.mark.skipif(sys.platform != "linux", reason="neither is on other systems")
def test_triton_is_loaded_before_the_graphics_library(tmp_path):
    """PyTorch's optimisers load it; after Mesa, which brings another LLVM, that crashes."""
    (tmp_path / "triton.py").write_text(
        "import pathlib\n"
        "libraries = pathlib.Path('/proc/self/maps').read_text()\n"
        "print('after' if 'libEGL' in libraries or 'libGL' in libraries else 'before')\n"
    )
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from contextlib import suppress\n"
        "from flyrl.bodies.worm import CRAWLER\n"
        "from flyrl.simulation.rendering import RenderingUnavailableError, WormRenderer\n"
        "from flyrl.simulation.scene import SceneConfig\n"
        "with suppress(RenderingUnavailableError): WormRenderer(SceneConfig(CRAWLER))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "before\n"


# ------------------------------------------------------------------ worms

WIDTH, HEIGHT = 96, 64


def drawn_worm(batch, camera="follow"):
    with drawing():
        renderer = WormRenderer(batch.scene.config, WIDTH, HEIGHT, camera)
    picture = renderer.render(batch, 0)
    renderer.close()
    return picture.astype(int)


@pytest.mark.parametrize("scene", [CRAWLING, HANGING], ids=["crawling", "hanging"])
@pytest.mark.parametrize("camera", ["follow", "top"])
def test_the_worm_is_in_the_middle_third_and_all_of_it_in_the_picture(scene, camera):
    """The only red thing; a crawling worm lies 60 mm off the middle of the ground."""
    batch = make_batch(scene)
    if scene is CRAWLING:
        batch.start(np.array([0]), [Episode(0, (60.0, 0.0, 0.0), 1.0, ())])
    is_worm = np.subtract(*np.moveaxis(drawn_worm(batch, camera), -1, 0)[:2]) > 30
    rows, columns = np.nonzero(is_worm)
    assert HEIGHT / 3 < rows.mean() < 2 * HEIGHT / 3
    assert WIDTH / 3 < columns.mean() < 2 * WIDTH / 3
    assert rows.min() > 0
    assert rows.max() < HEIGHT - 1
    assert columns.min() > 0
    assert columns.max() < WIDTH - 1
