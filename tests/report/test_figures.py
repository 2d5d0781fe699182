import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.rows import plain_rows
from flyrl.evaluation.trajectories import Trajectory
from flyrl.report.figures import (
    aligned,
    distributions_figure,
    paired_figure,
    success_figure,
    swarm,
    trajectories_figure,
)
from tests.synthetic import HORIZON_S, make_results

NAMES = ("target-ppo", "cpg", "hybrid", "zero")


@pytest.fixture(scope="module")
def results():
    return make_results(NAMES, terrains=("flat", "gapped"), episodes=6)


@pytest.fixture(scope="module")
def figures(results):
    rows = list(plain_rows(results.episodes))
    goals = [results.drawn["flat"][row["episode"]]["goal"] for row in rows]
    paths = list(results.trajectories.values())
    return {
        "success": success_figure(results.summary),
        "distributions": distributions_figure(
            results.episodes, "flat", HORIZON_S, ["time_to_goal_s", "speed_mm_s", "return"]
        ),
        "paired": paired_figure(results.episodes, results.summary, "flat", HORIZON_S),
        "trajectories": trajectories_figure(rows, paths, goals, "flat"),
    }


KINDS = ("success", "distributions", "paired", "trajectories")


def texts(svg):
    return ["".join(node.itertext()).strip() for node in ET.fromstring(svg).iter() if is_text(node)]


def is_text(node):
    return node.tag.endswith("}text")


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_is_one_well_formed_svg(figures, kind):
    assert ET.fromstring(figures[kind]).tag == "{http://www.w3.org/2000/svg}svg"


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_names_its_controllers(figures, kind):
    expected = [name for name in NAMES if kind != "paired" or name != "hybrid"]
    assert set(expected) <= set(texts(figures[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_scales_with_the_page(figures, kind):
    head = figures[kind].split(">", 1)[0]
    assert "viewBox" in head
    assert "width" not in head


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_takes_its_colours_from_the_page(figures, kind):
    svg = figures[kind]
    assert "var(--ink" in svg
    assert "#01fe" not in svg.lower()  # no marker colour is left
    assert "#ffffff" not in svg.lower()  # no background of its own


def test_ids_of_different_figures_differ(figures):
    ids = [re.findall(r'\bid="([^"]+)"', svg) for svg in figures.values()]
    together = [name for names in ids for name in set(names)]
    assert len(together) == len(set(together))


@pytest.mark.parametrize("kind", KINDS)
def test_every_reference_inside_a_figure_has_its_target(figures, kind):
    svg = figures[kind]
    targets = set(re.findall(r'\bid="([^"]+)"', svg))
    assert set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', svg)) != set()
    for pair in re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', svg):
        assert (pair[0] or pair[1]) in targets


def test_same_results_same_figure(results, figures):
    assert success_figure(results.summary) == figures["success"]


def test_success_shows_counts(results, figures):
    row = results.summary[0]
    assert f"{row['successes']}/{row['episodes']}" in texts(figures["success"])


def test_names_are_text_not_markup_nor_mathematics():
    results = make_results(("cpg", "hybrid"), episodes=2)
    for row in results.summary:
        row["controller"] = row["controller"].replace("cpg", "<b>$x_1$&")
    assert "<b>$x_1$&" in texts(success_figure(results.summary))


def test_no_comparison_no_paired_figure():
    results = make_results(("hybrid",), episodes=2)
    assert paired_figure(results.episodes, results.summary, "flat", HORIZON_S) == ""


def path(points, yaw=0.0):
    points = np.array(points, dtype=np.float32)
    return Trajectory(
        time_s=np.arange(len(points), dtype=np.float32),
        position_w=np.column_stack([points, np.ones(len(points), np.float32)]),
        yaw=np.full(len(points), yaw, np.float32),
        drive=np.zeros((len(points), 2), np.float32),
    )


def test_a_path_is_turned_until_its_goal_lies_ahead():
    walked, goal = aligned(path([(1, 1), (1, 3)]), (1, 5))
    np.testing.assert_allclose(goal, [4, 0], atol=1e-12)
    np.testing.assert_allclose(walked, [(0, 0), (2, 0)], atol=1e-12)


def test_left_of_the_goal_stays_left():
    # The goal is north; west of the way there is to the left, so y is positive.
    walked, _ = aligned(path([(0, 0), (-1, 2)]), (0, 4))
    np.testing.assert_allclose(walked[1], [2, 1], atol=1e-12)


def test_without_a_goal_the_heading_lies_ahead():
    walked, goal = aligned(path([(2, 2), (2, 5)], yaw=np.pi / 2), ())
    assert goal is None
    np.testing.assert_allclose(walked, [(0, 0), (3, 0)], atol=1e-6)


def test_swarm_keeps_lonely_dots_on_the_line():
    np.testing.assert_array_equal(swarm(np.array([0.0, 5.0, 10.0])), 0)


def test_swarm_spreads_equal_values_evenly():
    offsets = swarm(np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(np.diff(np.sort(offsets)), 0.09)
    assert offsets.sum() == pytest.approx(0)


def test_swarm_stays_within_its_row():
    assert np.abs(swarm(np.zeros(1000))).max() <= 0.32
