"""The demonstration of muscles: bar, video, table; and the figure of a muscle."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from flyrl.bodies.worm import DEMONSTRATION, WormConfig
from flyrl.report.captions import tension_bars
from flyrl.report.film import write_film
from flyrl.report.video import HOLD_FRAMES
from flyrl.report.walk_videos import film_worm
from flyrl.simulation.rendering import RenderingUnavailableError
from tests.report.test_video import read


def red(picture):
    red, green, blue = (picture[..., i].astype(int) for i in range(3))
    return (red > 150) & (green < 90) & (blue < 90)


@pytest.mark.parametrize(("tension", "filled"), [(0, 0), (0.01, 3), (0.5, 150), (1, 300)])
def test_a_bar_fills_with_red_in_proportion_to_tension(tension, filled):
    picture = tension_bars(np.full((480, 640, 3), 128, np.uint8), [tension])
    rows, columns = np.nonzero(red(picture))
    assert rows.size == 20 * filled
    if filled:
        assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (20, filled)
        # in the lower right corner, from the left
        assert rows.max() == 480 - 17
        assert columns.min() == 640 - 16 - 300


def test_bars_of_several_muscles_stand_one_below_the_other():
    picture = tension_bars(np.full((480, 640, 3), 128, np.uint8), [0.1, 0.4])
    filled = red(picture).sum(axis=1)
    assert filled[filled > 0].tolist() == [30] * 20 + [120] * 20


@pytest.fixture(scope="module")
def video():
    try:
        return film_worm(dataclasses.replace(DEMONSTRATION, segments=4), step=150, hold_s=0.2)
    except RenderingUnavailableError as error:
        pytest.skip(str(error))


def test_the_video_shows_the_bar_and_the_worm_that_bends(video, tmp_path):
    _, frames = read(video.mp4, tmp_path)
    assert len(frames) == 3 * 5 + HOLD_FRAMES
    # the bar's own pixels, but for its rim, which compression blurs
    bar = np.s_[480 - 33 : 480 - 19, 640 - 313 : 640 - 19]
    shares = [red(frame[bar]).mean() for frame in (frames[0], frames[9], frames[-1])]
    assert shares == pytest.approx(video.table["tension"], abs=0.03)
    above = np.s_[100:400]
    changed = np.abs(frames[-1][above].astype(int) - frames[0][above]).max(axis=2) > 40
    assert changed.mean() > 0.01


def test_the_table_holds_what_every_step_came_to(video):
    assert video.table["n"].tolist() == [0, 150, 300]
    assert video.table["tension"].iloc[[0, 2]].tolist() == [0, 1]
    assert video.table["bend_deg"].iloc[0] == pytest.approx(0, abs=1e-6)
    assert (np.diff(video.table["bend_deg"]) > 0).all()


def test_video_and_table_are_written(video, tmp_path):
    write_film(video, tmp_path / "new", "worm")
    assert (tmp_path / "new" / "worm.mp4").read_bytes() == video.mp4
    with Image.open(tmp_path / "new" / "worm.jpg") as poster:
        assert poster.size == (640, 480)
    table = pd.read_csv(tmp_path / "new" / "worm.csv")
    pd.testing.assert_frame_equal(table, video.table, rtol=1e-5, check_dtype=False)


def test_a_worm_with_more_muscles_is_not_filmed():
    with pytest.raises(ValueError, match="must have muscles='one', got 'pairs'"):
        film_worm(WormConfig())
