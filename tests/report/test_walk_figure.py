"""The figure of a walk, from a table worked out by hand."""

import numpy as np
import pandas as pd
import pytest

from flyrl.anatomy import JOINTS, LEGS
from flyrl.report.scene_figures import walk_figure


@pytest.fixture(scope="module")
def table():
    """0.5 s at 100 Hz, 3-4-5 mm/s; the left front leg stands in the first half."""
    time_s = np.arange(50) / 100
    columns = {"time_s": time_s, "vx_mm_s": np.full(50, 3.0), "vy_mm_s": np.full(50, 4.0)}
    columns |= {joint: np.full(50, i / 10) for i, joint in enumerate(JOINTS)}
    names = ("stance", "retracts", "stumbles")
    columns |= {f"{name}_{leg}": np.zeros(50) for name in names for leg in LEGS}
    columns["stumbles_RH"] = (time_s > 0.395).astype(float)
    columns["stance_LF"] = (time_s < 0.25).astype(float)
    return pd.DataFrame(columns)


def test_speed_is_that_of_the_thorax_over_the_ground(table):
    speed, _, _ = walk_figure(table).axes
    for line in speed.lines:
        np.testing.assert_allclose(line.get_ydata(), 5.0)


def test_chosen_joints_are_shown_in_degrees(table):
    _, angles, _ = walk_figure(table, joints=JOINTS[1:3]).axes
    shown = [line.get_ydata()[0] for line in angles.lines]
    np.testing.assert_allclose(shown, np.degrees([0.1, 0.2]))


def test_without_joints_there_is_no_panel_of_them(table):
    assert len(walk_figure(table, joints=[]).axes) == 2


def test_a_leg_has_a_bar_while_it_stands_and_while_a_reflex_corrects_it(table):
    _, _, gait = walk_figure(table).axes
    stances, reflexes = gait.collections[::2], gait.collections[1::2]
    (bar,) = stances[0].get_paths()
    assert bar.get_extents().x0 == pytest.approx(0.0)
    assert bar.get_extents().x1 == pytest.approx(0.25)
    assert [len(each.get_paths()) for each in stances[1:]] == [0] * 5
    (bar,) = reflexes[5].get_paths()
    assert bar.get_extents().x0 == pytest.approx(0.4)
    assert [len(each.get_paths()) for each in reflexes[:5]] == [0] * 5


def test_a_notebook_shows_it(table):
    assert walk_figure(table)._repr_png_().startswith(b"\x89PNG")


def test_a_joint_that_is_none_is_refused(table):
    with pytest.raises(ValueError, match="did you mean 'joint_LFTibia'"):
        walk_figure(table, joints=["joint_LFTibi"])
