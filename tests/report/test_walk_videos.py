"""The literature's videos of walks: what is in the table beside them."""

import dataclasses

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.report.video import HOLD_FRAMES
from flyrl.report.walk_videos import WALKS, film_walk
from flyrl.simulation.rendering import RenderingUnavailableError
from tests.report.test_video import read


@pytest.fixture(scope="module")
def film():
    walk = WALKS["turn_video"]
    walk = dataclasses.replace(walk, duration_s=0.03, body=WALKS["walk_cpg_without_adhesion"].body)
    try:
        return film_walk(walk)
    except RenderingUnavailableError as error:
        pytest.skip(str(error))


def test_the_table_has_a_row_per_picture(film, tmp_path):
    np.testing.assert_allclose(film.table["time_s"], [0.0, 0.01, 0.02, 0.03])
    _, frames = read(film.mp4, tmp_path)
    assert frames.shape == (4 + HOLD_FRAMES, 480, 640, 3)
    assert film.poster.startswith(b"\xff\xd8")


def test_the_table_tells_what_was_driven_and_what_came_of_it(film):
    table = film.table
    assert set(zip(table["drive_left"], table["drive_right"], strict=True)) == {(1.2, 0.2)}
    assert abs(table["yaw_deg"].iloc[0]) < 10
    # without adhesion nobody grips, and no leg is pulled down: each carries less than the fly
    assert not table[[f"grips_{leg}" for leg in LEGS]].to_numpy().any()
    forces = table[[f"force_uN_{leg}" for leg in LEGS]].to_numpy()
    assert forces.min() > -1e-6
    assert 1 < forces.sum(axis=1).mean() < 40
