import dataclasses
import re
from dataclasses import asdict
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from flyrl.evaluation.episodes import Trajectory
from flyrl.report.paths import (
    GROUND_SHADES,
    MAX_LEVELS,
    Thing,
    Walk,
    aligned_figure,
    finite,
    ground_figure,
    ground_symbol,
    levels,
    paths_figure,
    start_frame,
    things_of,
    view_of,
)
from flyrl.tasks import Episode
from flyrl.terrains import NOWHERE, Blocks, Bounds, Flat, Gapped, Mixed
from tests.report.conftest import texts

GAPPED = Gapped()
RANDOM = Gapped(gap_range=(0.1, 0.5), random=True)
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


def attributes(text):
    return {key: float(value) for key, value in re.findall(r'\b(\w+)="(-?[\d.]+)"', text)}


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
    x_min, y_min, width, height = map(float, re.search(r'viewBox="(-[^"]*)"', svg)[1].split())
    panels = svg.split('<g id="paths-gapped-panel-')[1:]
    assert len(panels) == 2
    for panel in panels:
        place = attributes(re.search(r'<use href="#paths-gapped-ground" [^>]*>', panel)[0])
        scale = place["width"] / width
        assert place["height"] / height == pytest.approx(scale, rel=1e-3)  # equal axes
        start, end = re.search(r'd="M ([\d.]+ [\d.]+) \nL ([\d.]+ [\d.]+) \n" clip', panel).groups()
        for text, (x, y) in ((start, (0, 0)), (end, (10, 4))):
            expected = (place["x"] + scale * (x - x_min), place["y"] + scale * (-y - y_min))
            np.testing.assert_allclose([float(n) for n in text.split()], expected, atol=0.05)


def test_the_ground_stands_once_in_a_figure_of_many_panels():
    svg, ground = section(GAPPED, walks((0, 0), (10, 4)))
    assert ground == "same"
    assert svg.count("<symbol") == 1
    assert svg.count('<use href="#paths-gapped-ground"') == 2


def test_random_ground_is_that_of_the_first_episode():
    svg, ground = section(RANDOM, walks((-9.5, 0), (-6, 0)))
    assert ground == "random"
    # The grounds of episodes have seeds from 2**32 on; gaps keep their middles.
    gap = np.random.default_rng(2**32 + 7).uniform(0.1, 0.5, size=26)[0]
    left, width = map(float, re.search(r' d="M(\S+) \S+h([\d.]+)', svg).groups())
    assert left + width == pytest.approx(-8.85 - gap / 2, abs=2e-3)


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
    assert "<symbol" not in svg


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


def layers(config, view):
    """Opacity and path data of each level, the lowest first."""
    symbol = ground_symbol(config.compiled().boxes, view, "g")
    return re.findall(r'fill-opacity="([\d.]+)" d="([^"]*)"', symbol)


def test_gaps_are_bare():
    # Slabs of 1 mm start at -10 mm, with 0.3 mm between them; y points down, as SVG has it.
    ((_, slabs),) = layers(Gapped(), Bounds(-10, -7, 0, 5))
    assert slabs == "M-10 -5h1v5h-1zM-8.7 -5h1v5h-1zM-7.4 -5h0.4v5h-0.4z"


def test_high_blocks_are_laid_over_the_low_ground():
    # Blocks of 1.1 * 1.3 mm at a pitch of 1.3 mm; the first stands out, its neighbours do not.
    (_, low), (_, high) = layers(Blocks(), Bounds(-11, -8.8, -21, -18.8))
    corner = "M-10.065 18.8h1.265v1.265h-1.265z"
    assert (low, high) == (corner + corner, corner)  # the low ground goes on below the block
    (_, low), (_, high) = layers(Blocks(), Bounds(-8.6, -7.5, -20, -18.8))
    assert low == "M-8.6 18.8h1.1v1.2h-1.1z"
    assert high == ""  # between two high blocks there is a low one: 1.17 mm wide


def test_what_is_out_of_view_is_not_drawn():
    ((_, slabs),) = layers(Gapped(), Bounds(-8.9, -8.8, 0, 5))
    assert slabs == ""


def test_the_layers_of_the_highest_ground_come_to_its_shade():
    shades = [float(shade) for shade, _ in layers(Mixed(), Bounds(-4, 23, -5, 5))]
    assert shades[0] == GROUND_SHADES[0]
    assert 1 - np.prod(1 - np.array(shades)) == pytest.approx(GROUND_SHADES[1], abs=1e-3)


def test_a_few_heights_are_told_apart():
    np.testing.assert_array_equal(levels(np.array([0.45, 0.1, 0.1 + 1e-9, 0.45])), [0.1, 0.45])


def test_many_heights_are_put_together():
    heights = levels(np.linspace(0.0, 1.2, 100))
    assert MAX_LEVELS == 6
    np.testing.assert_allclose(heights, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
