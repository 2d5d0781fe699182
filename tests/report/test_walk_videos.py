"""The literature's videos, and what is in the tables beside them."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from flyrl.anatomy import LEGS
from flyrl.bodies.fly import FlyConfig
from flyrl.bodies.worm import DEMONSTRATION
from flyrl.report.gallery import write
from flyrl.report.video import HOLD_FRAMES
from flyrl.report.walk_videos import WALKS, film_worm
from tests.pictures import drawing
from tests.report.test_captions import red
from tests.report.test_video import read


@pytest.fixture(scope="module")
def film():
    with drawing():
        return WALKS["turn_video"](duration_s=0.03, body=FlyConfig(adhesion_gain=0.0))


def test_the_table_tells_what_was_driven_and_what_came_of_it_picture_by_picture(film, tmp_path):
    table = film.table
    np.testing.assert_allclose(table["time_s"], [0.0, 0.01, 0.02, 0.03])
    _, frames = read(film.mp4, tmp_path)
    assert frames.shape == (4 + HOLD_FRAMES, 480, 640, 3)
    assert film.poster.startswith(b"\xff\xd8")
    assert set(zip(table["drive_left"], table["drive_right"], strict=True)) == {(1.2, 0.2)}
    assert abs(table["yaw_deg"].iloc[0]) < 10
    # without adhesion nobody grips, and no leg is pulled down: each carries less than the fly
    assert not table[[f"grips_{leg}" for leg in LEGS]].to_numpy().any()
    forces = table[[f"force_uN_{leg}" for leg in LEGS]].to_numpy()
    assert forces.min() > -1e-6
    assert 1 < forces.sum(axis=1).mean() < 40


@pytest.fixture(scope="module")
def worm():
    with drawing():
        return film_worm(dataclasses.replace(DEMONSTRATION, segments=4), step=150, hold_s=0.2)


def test_video_and_table_show_the_tension_and_the_worm_that_bends(worm, tmp_path):
    _, frames = read(worm.mp4, tmp_path)
    assert len(frames) == 3 * 5 + HOLD_FRAMES
    # the bar's own pixels, but for its rim, which compression blurs
    bar = np.s_[480 - 33 : 480 - 19, 640 - 313 : 640 - 19]
    shares = [red(frame[bar]).mean() for frame in (frames[0], frames[9], frames[-1])]
    assert shares == pytest.approx(worm.table["tension"], abs=0.03)
    above = np.s_[100:400]
    changed = np.abs(frames[-1][above].astype(int) - frames[0][above]).max(axis=2) > 40
    assert changed.mean() > 0.01
    assert worm.table["n"].tolist() == [0, 150, 300]
    assert worm.table["tension"].iloc[[0, 2]].tolist() == [0, 1]
    at_rest, half, whole = worm.table["bend_deg"]
    assert at_rest == pytest.approx(0, abs=1e-6)
    assert whole > 5 * half > 0


def test_video_and_table_are_written(worm, tmp_path):
    write(worm, tmp_path, "worm")
    assert (tmp_path / "worm.mp4").read_bytes() == worm.mp4
    with Image.open(tmp_path / "worm.jpg") as poster:
        assert poster.size == (640, 480)
    table = pd.read_csv(tmp_path / "worm.csv")
    pd.testing.assert_frame_equal(table, worm.table, rtol=1e-5, check_dtype=False)
