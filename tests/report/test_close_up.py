import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.drive_map import DriveMap
from flyrl.report.close_up import drive_map_figure, gait_figure, spans
from flyrl.rollouts import Gait
from tests.synthetic import make_record


def walked(controller, way=10):
    """An episode of 1 s and `way` mm with strides of 100 ms, of which legs stand for 60."""
    stance = np.repeat(((np.arange(1000) // 10) % 10 < 6)[:, np.newaxis], 6, axis=1)
    none = np.zeros_like(stance)
    return make_record(
        [(0, 0), (way, 0)],
        controller=controller,
        interval_s=1.0,
        gait=Gait(1e-3, stance, stance, none, none, 0.0, np.zeros(6)),
    )


def texts(svg):
    return [element.text for element in ET.fromstring(svg).iter() if element.text]


def test_spans_of_a_raster():
    raster = np.array([True, True, False, True, False])
    assert spans(raster, 0.5) == [(0.0, 1.0), (1.5, 0.5)]
    assert spans(np.zeros(3, bool), 0.5) == []
    assert spans(np.ones(3, bool), 0.5) == [(0.0, 1.5)]


def test_a_gait_diagram_has_a_row_per_leg_of_everyone():
    svg = gait_figure([walked("cpg"), walked("hybrid")], "gait")
    found = texts(svg)
    assert {"cpg", "hybrid", "LF", "RH"} <= set(found)
    assert found.count("LM") == 2


def test_bars_are_where_legs_stand():
    few, many = (gait_figure([walked(name)] * n, "gait") for name, n in (("cpg", 1), ("cpg", 2)))
    # 10 strides of 6 legs
    assert many.count("<path") - few.count("<path") >= 60


def test_a_body_that_stands_is_drawn_in_stance():
    walking, standing = (gait_figure([walked("cpg", way)], "gait") for way in (10, 1))
    # a bar per leg instead of 10
    assert walking.count("<path") - standing.count("<path") == 9 * 6


@pytest.fixture
def drive_map():
    drives = np.linspace(-0.5, 1.5, 5)
    left, right = np.meshgrid(drives, drives, indexing="ij")
    speed = 10 * (left + right) / 2
    speed[0, 4] = np.nan
    return DriveMap(drives, speed, 100 * (right - left))


def test_a_drive_map_names_whose_drives_are_on_top(drive_map):
    found = texts(drive_map_figure(drive_map, {"mine": np.ones((30, 2))}, "map"))
    assert {"mine", "right drive", "left drive", "speed (mm/s)"} <= set(found)


def test_nobody_has_to_be_on_top(drive_map):
    assert "left drive" in texts(drive_map_figure(drive_map, {}, "map"))


def test_a_map_of_noise_has_no_contours(drive_map):
    noise = dataclasses.replace(
        drive_map,
        speed_error_mm_s=np.full((5, 5), 100.0),
        yaw_rate_error_deg_s=np.full((5, 5), 1000.0),
    )
    clear, noisy = (drive_map_figure(each, {}, "map") for each in (drive_map, noise))
    assert len(texts(noisy)) < len(texts(clear))  # no labels of contours
