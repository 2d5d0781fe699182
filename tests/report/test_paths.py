import dataclasses
import re
from dataclasses import asdict

import numpy as np
import pytest

from flyrl.evaluation.results import Trajectory
from flyrl.report.paths import (
    Thing,
    Walk,
    aligned,
    aligned_figure,
    ground_figure,
    paths_section,
    shown,
    things_of,
)
from flyrl.tasks import Episode
from flyrl.terrains import NOWHERE, Bounds, Flat, Gapped

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


def walks(*points, goal=()):
    """Two controllers on the same two paths."""
    own = [Walk(i, path(points), goal, outcome) for i, outcome in enumerate(("fall", "success"))]
    return {"cpg": own, "hybrid": own}


def section(config, given, episodes=EPISODES):
    terrain = {
        "name": config.label,
        "config": asdict(config),
    }
    return paths_section(given, terrain, [asdict(episode) for episode in episodes])


def attributes(text):
    return {key: float(value) for key, value in re.findall(r'\b(\w+)="(-?[\d.]+)"', text)}


def test_the_view_holds_paths_and_goals():
    given = walks((0, 0), (10, 4), goal=(12, 7))
    assert shown(given, GAPPED.bounds) == Bounds(-2, 14, -2, 9)


def test_the_view_ends_where_the_ground_ends():
    given = walks((0, 0), (80, -90))
    assert shown(given, GAPPED.bounds) == Bounds(-2, 27, -22, 2)


def test_a_fly_that_stays_is_shown_with_its_surroundings():
    given = walks((1, 1), (1, 1))
    assert shown(given, GAPPED.bounds) == Bounds(-3, 5, -3, 5)


def test_ground_and_paths_lie_on_one_another():
    svg = ground_figure(walks((0, 0), (10, 4)), GAPPED, GAPPED.compiled())
    x_min, y_min, width, height = map(float, re.search(r'viewBox="(-[^"]*)"', svg)[1].split())
    panels = svg.split('<g id="trajectories-gapped-panel-')[1:]
    assert len(panels) == 2
    for panel in panels:
        place = attributes(re.search(r'<use href="#trajectories-gapped-ground" [^>]*>', panel)[0])
        scale = place["width"] / width
        assert place["height"] / height == pytest.approx(scale, rel=1e-3)  # equal axes
        start, end = re.search(r'd="M ([\d.]+ [\d.]+) \nL ([\d.]+ [\d.]+) \n" clip', panel).groups()
        for text, (x, y) in ((start, (0, 0)), (end, (10, 4))):
            expected = (place["x"] + scale * (x - x_min), place["y"] + scale * (-y - y_min))
            np.testing.assert_allclose([float(n) for n in text.split()], expected, atol=0.05)


def test_the_ground_stands_once_in_a_figure_of_many_panels():
    svg = section(GAPPED, walks((0, 0), (10, 4)))["figure"]
    assert svg.count("<symbol") == 1
    assert svg.count('<use href="#trajectories-gapped-ground"') == 2


def test_random_ground_is_that_of_the_first_episode():
    found = section(RANDOM, walks((-9.5, 0), (-6, 0)))
    assert found["ground"] == "random"
    # The grounds of episodes have seeds from 2**32 on; gaps keep their middles.
    gap = np.random.default_rng(2**32 + 7).uniform(0.1, 0.5, size=26)[0]
    left, width = map(float, re.search(r' d="M(\S+) \S+h([\d.]+)', found["figure"]).groups())
    assert left + width == pytest.approx(-8.85 - gap / 2, abs=2e-3)


def test_on_random_ground_only_the_first_path_is_drawn():
    lines = [
        section(config, walks((0, 0), (10, 4)))["figure"].count("stroke-width: 0.9")
        for config in (GAPPED, RANDOM)
    ]
    assert lines[0] == lines[1] + 2  # one path less of each of two controllers


def test_random_ground_without_its_episodes_is_not_drawn():
    assert section(RANDOM, walks((0, 0), (10, 4)), episodes=())["ground"] == "none"


def test_flat_ground_has_nothing_to_draw():
    found = section(Flat(), walks((0, 0), (10, 4)))
    assert found["ground"] == "none"
    assert "<symbol" not in found["figure"]


def test_who_did_not_walk_has_no_panel():
    given = {"zero": [], **walks((0, 0), (10, 4))}
    assert "zero" not in section(GAPPED, given)["figure"]
    assert section(GAPPED, {"zero": []}) is None


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
