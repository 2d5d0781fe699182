import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from flyrl.report.close_up import (
    advance_mm,
    goal_distance_mm,
    held_drive,
    speed_mm_s,
    time_figure,
)
from tests.synthetic import make_record


def walked(samples=51, speed=10.0, **kwargs):
    """Straight ahead from (2, 1), a sample every 20 ms."""
    x = 2 + speed * 0.02 * np.arange(samples)
    return make_record(np.column_stack([x, np.ones(samples)]), **kwargs)


def texts(svg):
    return {element.text for element in ET.fromstring(svg).iter() if element.text}


def panels_drawn(svg, name):
    """Left, top, right and bottom of every closed rectangle: the figure's, and each panel's."""
    boxes = []
    for path in re.findall(rf'<g id="{name}-patch_\d+">\s*<path d="([^"]*z)', svg):
        corners = np.array(re.findall(r"([\d.]+) ([\d.]+)", path), dtype=float)
        boxes.append((*corners.min(axis=0), *corners.max(axis=0)))
    return boxes


def test_the_way_is_along_x():
    np.testing.assert_allclose(advance_mm(walked())[[0, 1, 50]], [0, 0.2, 10])


def test_the_distance_to_the_goal_is_horizontal():
    record = walked(goal=(5.0, 5.0))
    # 3 mm ahead and 4 mm aside; after 3 mm of way, 4 mm
    np.testing.assert_allclose(goal_distance_mm(record)[[0, 15]], [5, 4])


def test_speed_is_not_drawn_where_its_window_leaves_the_episode():
    # 0.1 s around a sample every 20 ms: the first three and the last three lack a part of it
    speed = speed_mm_s(walked())
    assert np.isnan(speed[[0, 1, 2, -3, -2, -1]]).all()
    np.testing.assert_allclose(speed[3:-3], 10.0)


def test_speed_is_that_over_a_stride():
    # Stands, then is 0.5 mm further from one sample to the next: 0.5 mm in 0.1 s while it sees it.
    x = np.repeat([0.0, 0.5], 10)
    record = make_record(np.column_stack([x, 0 * x]))
    # samples 9 and 10 are before and after; 0.05 s are two samples and a half
    np.testing.assert_allclose(speed_mm_s(record)[6:14], [0, 2.5, 5, 5, 5, 5, 2.5, 0], atol=1e-9)


def test_one_sample_alone_has_no_speed():
    assert np.isnan(speed_mm_s(walked(1, duration_s=0.02))).all()
    time_figure([walked(1, duration_s=0.02)], "time")


def test_a_drive_is_held_from_the_start():
    drive = [(0, 0), (1, 0.5), (0.2, 0.3)]
    np.testing.assert_array_equal(
        held_drive(walked(3, drive=drive)), [(1, 0.5), (1, 0.5), (0.2, 0.3)]
    )


def test_panels_are_where_they_are_said_to_be():
    figure = time_figure([walked()], "time")
    assert figure.until_s == pytest.approx(1.0)
    drawn = panels_drawn(figure.svg, "time")
    assert len(drawn) == 1 + 4
    np.testing.assert_allclose(sorted(figure.panels), sorted(drawn[1:]), atol=0.02)


def test_a_line_ends_at_its_time():
    """A steady walk of 0.4 of 1 s ends at 0.4 of its panel, with a dot."""
    figure = time_figure([walked(21)], "time", 1.0)
    left, _, right, _ = figure.panels[0]
    dots = re.findall(r'<use [^>]*x="([\d.]+)"', figure.svg)
    assert f"{left + 0.4 * (right - left):.2f}" in dots


def test_what_goes_on_has_no_dot():
    going, ending = (time_figure([walked(n)], "time", 0.5).svg for n in (51, 21))
    assert ending.count("<use ") - going.count("<use ") == 4


@pytest.mark.parametrize(
    ("goal", "title"), [((), "way along +x (mm)"), ((9, 9), "distance to the goal (mm)")]
)
def test_everyone_is_named_and_the_task_decides_which_way_is_shown(goal, title):
    records = [walked(goal=goal, controller=name) for name in ("cpg", "hybrid")]
    assert {"cpg", "hybrid", title, "left drive", "right drive"} <= texts(
        time_figure(records, "time").svg
    )


def test_of_a_worm_tensions_are_shown():
    fly = walked()
    worm = dataclasses.replace(fly, creature="worm", drive=np.full((51, 8), 0.5))
    shown = texts(time_figure([worm], "time").svg)
    assert {"tension of the first muscle", "mean tension"} <= shown
    assert not {"left drive", "right drive"} & shown
