import dataclasses
import re
from dataclasses import asdict
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.episodes import Trajectory
from flyrl.report.paths import (
    LEVELS,
    Thing,
    Walk,
    aligned_figure,
    finite,
    ground_figure,
    ground_picture,
    paths_figure,
    start_frame,
    things_of,
    view_of,
)
from flyrl.tasks import Episode
from flyrl.terrains import NOWHERE, Blocks, Bounds, Flat, Gapped, Hills
from tests.report.conftest import texts

GAPPED = Gapped()
RANDOM = Gapped(gap_range=(0.1, 0.5), random=True)
HILLS = Hills()
VIEW = Bounds(-11, 3, -20, 2)
EPISODES = [Episode(seed, (0.0, 0.0, 1.5), 0.0, (), (0.0,) * 6, (0.0,) * 6) for seed in (7, 8)]


def path(points, yaw=0.0):
    points = np.array(points, dtype=np.float32)
    return Trajectory(
        time_s=np.arange(len(points), dtype=np.float32),
        position_w=np.column_stack([points, np.ones(len(points), np.float32)]),
        yaw=np.full(len(points), yaw, np.float32),
        drive=np.zeros((len(points), 2), np.float32),
    )


@pytest.mark.parametrize(
    ("walked", "yaw", "goal", "end"),
    [
        # the goal lies ahead
        ([(1, 1), (1, 3)], 0.0, (1, 5), (2, 0)),
        # the goal is north; west of the way there is to the left, so y is positive
        ([(0, 0), (-1, 2)], 0.0, (0, 4), (2, 1)),
        # without a goal the heading lies ahead
        ([(2, 2), (2, 5)], np.pi / 2, (), (3, 0)),
    ],
)
def test_a_path_is_turned_until_its_goal_or_heading_lies_ahead(walked, yaw, goal, end):
    walked = path(walked, yaw)
    origin, rotation = start_frame(walked, goal)
    np.testing.assert_allclose((finite(walked) - origin) @ rotation, [(0, 0), end], atol=1e-6)


def walks(*points, goal=()):
    """Two controllers on the same two paths."""
    own = [Walk(i, path(points), goal, outcome) for i, outcome in enumerate(("fall", "success"))]
    return {"cpg": own, "hybrid": own}


def section(config, given, episodes=EPISODES):
    terrain = {"name": config.label, "config": asdict(config)}
    return paths_figure(given, terrain, [asdict(episode) for episode in episodes])


@pytest.mark.parametrize(
    ("given", "view"),
    [
        (walks((0, 0), (10, 4), goal=(12, 7)), Bounds(-2, 14, -2, 9)),
        # the view ends where the ground ends
        (walks((0, 0), (80, -90)), Bounds(-2, 27, -22, 2)),
        # a fly that stays is shown with its surroundings
        (walks((1, 1), (1, 1)), Bounds(-3, 5, -3, 5)),
    ],
)
def test_the_view_holds_paths_and_goals(given, view):
    assert view_of(given, GAPPED.bounds) == view


def test_ground_and_paths_lie_on_one_another():
    svg = ground_figure(walks((0, 0), (10, 4)), GAPPED, GAPPED.compiled())
    panels = re.findall(r"<image .*?(?=<image |$)", svg, re.DOTALL)
    assert len(panels) == 2
    view = view_of(walks((0, 0), (10, 4)), GAPPED.bounds)
    for panel in panels:
        width, height = (
            float(re.search(rf'{key}="(\d+)"', panel)[1]) for key in ("width", "height")
        )
        across, up, left, bottom = map(
            float, re.search(r"matrix\((\S+) 0 0 -(\S+) (\S+) (\S+)\)", panel).groups()
        )
        assert across == pytest.approx(up, rel=5e-3)  # equal axes
        ends = re.search(r'd="M ([\d.]+ [\d.]+) \nL ([\d.]+ [\d.]+) \n" clip', panel).groups()
        for text, (x, y) in zip(ends, ((0, 0), (10, 4)), strict=True):
            column = width * (x - view.x_min) / (view.x_max - view.x_min)
            row = height * (y - view.y_min) / (view.y_max - view.y_min)
            expected = (left + across * column, bottom - up * row)
            np.testing.assert_allclose([float(n) for n in text.split()], expected, atol=0.1)


def test_random_ground_is_that_of_the_first_episode():
    svg, ground = section(RANDOM, walks((-9.5, 0), (-6, 0)))
    assert ground == "random"
    other, _ = section(RANDOM, walks((-9.5, 0), (-6, 0)), EPISODES[::-1])
    assert picture_of(svg) != picture_of(other)


def picture_of(svg):
    return re.search(r'href="(data:image/png[^"]*)"', svg)[1]


def test_on_random_ground_only_the_first_path_is_drawn():
    lines = [
        section(config, walks((0, 0), (10, 4)))[0].count("stroke-width: 0.9")
        for config in (GAPPED, RANDOM)
    ]
    assert lines[0] == lines[1] + 2  # one path less of each of two controllers


@pytest.mark.parametrize(("config", "episodes"), [(RANDOM, ()), (Flat(), EPISODES)])
def test_flat_ground_and_one_that_is_not_known_are_not_drawn(config, episodes):
    svg, ground = section(config, walks((0, 0), (10, 4)), episodes)
    assert ground == "none"
    assert "<image" not in svg


def test_who_did_not_walk_has_no_panel():
    svg, _ = section(GAPPED, {"zero": [], **walks((0, 0), (10, 4))})
    assert {"cpg", "hybrid"} <= set(texts(svg))
    assert "zero" not in texts(svg)
    assert section(GAPPED, {"zero": []}) == ("", "none")


def test_titles_of_paths_are_not_cut_off():
    svg = ET.fromstring(aligned_figure(walks((0, 0), (10, 4)), "flat"))
    (title,) = (node for node in svg.findall(".//{*}text") if node.text.strip() == "cpg")
    assert float(title.get("y")) > 9  # its baseline; a line has 10 points


PROTOCOL = {
    "table": {
        "props": [
            {"name": "post", "shape": "cylinder", "size": [0.5, 4.0], "rgba": [0.2, 0.4, 0.6, 1.0]},
            {"name": "wall", "shape": "box", "size": [1.0, 6.0, 2.0], "rgba": [0.0, 0.0, 0.0, 1.0]},
        ]
    }
}


def test_things_are_where_props_start_and_as_wide():
    episode = {"props": [5.0, 1.0, 2.0, *NOWHERE]}
    assert things_of(episode, PROTOCOL) == (Thing(5.0, 1.0, 0.5, (0.2, 0.4, 0.6)),)
    both = things_of({"props": [5.0, 1.0, 2.0, 0.0, 9.0, 1.0]}, PROTOCOL)
    assert both[1] == Thing(0.0, 9.0, 3.0, (0.0, 0.0, 0.0))


def test_results_of_old_have_no_things():
    assert things_of({"goal": [1.0, 2.0]}, {}) == ()


def test_things_are_drawn_on_the_map():
    thing = Thing(3.0, 1.0, 0.5, (0.2, 0.4, 0.6))

    def with_things(*things):
        return {
            name: [dataclasses.replace(each, things=things) for each in own]
            for name, own in walks((0, 0), (10, 4)).items()
        }

    for draw in (
        lambda given: aligned_figure(given, "flat"),
        lambda given: ground_figure(given, GAPPED, GAPPED.compiled()),
    ):
        # 0.2, 0.4, 0.6 as hexadecimal
        assert "#336699" in draw(with_things(thing))
        assert "#336699" not in draw(with_things())


def opacity(config, *places, view=VIEW):
    """Of the picture of the ground at places, mm."""
    picture = ground_picture(config, config.draw(config.seed), view)[..., 3]
    rows, columns = picture.shape
    return [
        picture[
            int(rows * (y - view.y_min) / (view.y_max - view.y_min)),
            int(columns * (x - view.x_min) / (view.x_max - view.x_min)),
        ]
        for x, y in places
    ]


def test_gaps_are_bare():
    # slabs of 1 mm start at -10 mm, with 0.3 mm between them
    assert opacity(Gapped(), (-9.5, 0), (-8.85, 0), (-8.5, 0)) == [0.15, 0, 0.15]


def test_the_higher_the_ground_the_stronger_its_shade():
    # blocks of 1.1 * 1.3 mm at a pitch of 1.3 mm; the first stands out, its neighbours do not
    assert opacity(Blocks(), (-9.4, -19.4), (-8.1, -19.4)) == [0.5, 0.15]
    middle, slope = opacity(HILLS, (0, 0)), ground_picture(HILLS, HILLS.draw(0), VIEW)[..., 3]
    assert 0.15 <= middle[0] <= 0.5
    assert len(np.unique(slope)) == LEVELS
