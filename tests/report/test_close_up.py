import dataclasses
import re

import numpy as np
import pandas as pd
import pytest

from flyrl.anatomy import JOINTS, LEGS
from flyrl.report.close_up import (
    courses,
    drive_map_figure,
    gait_figure,
    held_drive,
    spans,
    speed_mm_s,
    time_figure,
    walk_figure,
)
from flyrl.report.style import inline, svg_text
from tests.report.conftest import drive_map, gaited, texts
from tests.synthetic import make_record


def straight(samples=51, speed=10.0, **kwargs):
    """Straight ahead from (2, 1), a sample every 20 ms."""
    x = 2 + speed * 0.02 * np.arange(samples)
    return make_record(np.column_stack([x, np.ones(samples)]), **kwargs)


def test_spans_of_a_raster():
    raster = np.array([True, True, False, True, False])
    assert spans(raster, 0.5) == [(0.0, 1.0), (1.5, 0.5)]
    assert spans(np.zeros(3, bool), 0.5) == []
    assert spans(np.ones(3, bool), 0.5) == [(0.0, 1.5)]


def bars(axes):
    """Start and end of the bars of each leg, and of its reflexes."""
    spans = [[path.get_extents() for path in each.get_paths()] for each in axes.collections]
    return [[(box.x0, box.x1) for box in each] for each in spans]


def test_a_gait_diagram_has_a_bar_per_stride_of_every_leg_and_one_where_the_body_stands():
    figure = gait_figure([gaited("cpg"), gaited("hybrid", way=1)])
    assert {"cpg", "hybrid", *LEGS} <= set(texts(figure))
    walking, standing = (bars(axes) for axes in figure.axes)
    assert [len(each) for each in walking] == [10] * 6 + [0] * 12
    assert [len(each) for each in standing] == [1] * 6 + [0] * 12


def test_a_map_of_noise_has_no_contours_and_a_policy_is_named():
    clear = drive_map()
    noise = dataclasses.replace(
        clear,
        speed_error_mm_s=np.full((5, 5), 100.0),
        yaw_rate_error_deg_s=np.full((5, 5), 1000.0),
    )
    shown, noisy = (
        texts(drive_map_figure(each, {"mine": np.ones((30, 2))})) for each in (clear, noise)
    )
    assert {"mine", "right drive", "left drive", "speed (mm/s)"} <= set(shown)
    assert len(noisy) < len(shown)  # no labels of contours


@pytest.mark.parametrize(
    ("goal", "title", "way"),
    [
        ((), "way along +x (mm)", [0, 3, 10]),
        # 3 mm ahead and 4 mm aside; after 3 mm of way, 4 mm
        ((5.0, 5.0), "distance to the goal (mm)", [5, 4, np.hypot(7, 4)]),
    ],
)
def test_the_task_decides_which_way_is_shown(goal, title, way):
    shown = courses(straight(goal=goal))
    assert [*shown][2:] == ["left drive", "right drive"]
    np.testing.assert_allclose(shown[title][[0, 15, 50]], way)


def test_of_a_worm_tensions_are_shown():
    worm = dataclasses.replace(straight(), creature="worm", drive=np.full((51, 8), 0.5))
    assert [*courses(worm)][2:] == ["tension of the first muscle", "mean tension"]


def test_speed_is_not_drawn_where_its_window_leaves_the_episode():
    # 0.1 s around a sample every 20 ms: the first three and the last three lack a part of it
    speed = speed_mm_s(straight())
    assert np.isnan(speed[[0, 1, 2, -3, -2, -1]]).all()
    np.testing.assert_allclose(speed[3:-3], 10.0)
    alone = straight(1, duration_s=0.02)
    assert np.isnan(speed_mm_s(alone)).all()
    time_figure([alone], 0.02)


def test_speed_is_that_over_a_stride():
    # Stands, then is 0.5 mm further from one sample to the next: 0.5 mm in 0.1 s while it sees it.
    x = np.repeat([0.0, 0.5], 10)
    record = make_record(np.column_stack([x, 0 * x]))
    # samples 9 and 10 are before and after; 0.05 s are two samples and a half
    np.testing.assert_allclose(speed_mm_s(record)[6:14], [0, 2.5, 5, 5, 5, 5, 2.5, 0], atol=1e-9)


def test_a_drive_is_held_from_the_start():
    record = straight(3, drive=[(0, 0), (1, 0.5), (0.2, 0.3)])
    np.testing.assert_array_equal(held_drive(record), [(1, 0.5), (1, 0.5), (0.2, 0.3)])


def test_a_line_ends_at_its_time():
    """A steady walk of 0.4 of 1 s ends at 0.4 of its panel, with a dot; as the player finds it."""
    svg = inline(svg_text(time_figure([straight(21)], 1.0)), "time")
    panels = re.findall(r'<g id="time-axes_\d+">.*?<path d="(.*?)z', svg, re.DOTALL)
    assert len(panels) == 4
    left, bottom, right, again, _, top, *_ = map(float, re.findall(r"[\d.]+", panels[0]))
    assert left < right and top < bottom == again
    assert f"{left + 0.4 * (right - left):.2f}" in re.findall(r'<use [^>]*x="([\d.]+)"', svg)


def test_what_goes_on_has_no_dot():
    going, ending = (time_figure([straight(n)], 0.5) for n in (51, 21))
    assert [len(axes.lines) for axes in going.axes] == [1] * 4
    assert [len(axes.lines) for axes in ending.axes] == [2] * 4


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


def test_a_walk_is_drawn_with_its_speed_and_the_chosen_joints_in_degrees(table):
    figure = walk_figure(table, joints=JOINTS[1:3])
    speed, angles, _ = figure.axes
    for line in speed.lines:
        np.testing.assert_allclose(line.get_ydata(), 5.0)
    shown = [line.get_ydata()[0] for line in angles.lines]
    np.testing.assert_allclose(shown, np.degrees([0.1, 0.2]))
    assert figure._repr_png_().startswith(b"\x89PNG")  # a notebook shows it


def test_a_leg_has_a_bar_while_it_stands_and_while_a_reflex_corrects_it(table):
    _, gait = walk_figure(table, joints=[]).axes
    expected = [[pytest.approx((0.0, 0.25))], *[[]] * 10, [pytest.approx((0.4, 0.5))]]
    assert bars(gait) == expected
    with pytest.raises(ValueError, match="did you mean 'joint_LFTibia'"):
        walk_figure(table, joints=["joint_LFTibi"])
