import dataclasses
import re
from dataclasses import asdict

import numpy as np
import pytest

from flyrl.evaluation.episodes import Trajectory
from flyrl.report.paths import (
    LEVELS,
    Thing,
    Walk,
    aligned,
    aligned_figure,
    ground_figure,
    ground_picture,
    paths_figure,
    things_of,
    view_of,
    walk_of,
)
from flyrl.report.style import svg_text
from flyrl.tasks import Episode
from flyrl.terrains import NOWHERE, Blocks, Bounds, Flat, Gapped, Hills
from tests.report.conftest import texts

GAPPED = Gapped()
RANDOM = Gapped(gap_range=(0.1, 0.5), random=True)
HILLS = Hills()
VIEW = Bounds(-11, 3, -20, 2)
EPISODES = [Episode(seed, (0.0, 0.0, 1.5), 0.0, (), (0.0,) * 6, (0.0,) * 6) for seed in (7, 8)]
PROTOCOL = {
    "table": {
        "props": [
            {"name": "post", "shape": "cylinder", "size": [0.5, 4.0], "rgba": [0.2, 0.4, 0.6, 1.0]},
            {"name": "wall", "shape": "box", "size": [1.0, 6.0, 2.0], "rgba": [0.0, 0.0, 0.0, 1.0]},
        ]
    }
}


def walk(*points, yaw=0.0, goal=(), **other):
    goals = np.reshape(np.array(goal, float), (-1, 2))
    return Walk(
        **{"episode": 0, "outcome": "fall", **other},
        path=np.array(points, float),
        yaw=yaw,
        goals=goals,
    )


@pytest.mark.parametrize(
    ("walked", "end"),
    [
        # the goal lies ahead
        (walk((1, 1), (1, 3), goal=(1, 5)), (2, 0)),
        # the goal is north; west of the way there is to the left, so y is positive
        (walk((0, 0), (-1, 2), goal=(0, 4)), (2, 1)),
        # without a goal the heading lies ahead
        (walk((2, 2), (2, 5), yaw=np.pi / 2), (3, 0)),
    ],
)
def test_a_path_is_turned_until_its_goal_or_heading_lies_ahead(walked, end):
    turned = aligned(walked)
    np.testing.assert_allclose(turned.path, [(0, 0), end], atol=1e-9)
    assert all(y == pytest.approx(0) and x > 0 for x, y in turned.goals)


def test_a_walk_is_drawn_as_far_as_it_is_finite():
    path = np.array([(0, 0, 1), (1, 2, 1), (np.nan, 0, 1)], np.float32)
    recorded = Trajectory(np.arange(3.0), path, np.full(3, 0.5), np.zeros((3, 2)))
    drawn = walk_of(4, recorded, {"goal": [3.0, 4.0]}, "unstable", {})
    assert (drawn.path.tolist(), drawn.goals.tolist()) == ([[0, 0], [1, 2]], [[3, 4]])
    assert (drawn.episode, drawn.yaw, drawn.outcome) == (4, 0.5, "unstable")


def walks(*points, goal=()):
    """Two controllers on the same two paths."""
    outcomes = enumerate(("fall", "success"))
    own = [walk(*points, goal=goal, episode=i, outcome=outcome) for i, outcome in outcomes]
    return {"cpg": own, "hybrid": own}


def section(config, given, episodes=EPISODES):
    terrain = {"name": config.label, "config": asdict(config)}
    figure, ground = paths_figure(given, terrain, [asdict(episode) for episode in episodes])
    return figure and svg_text(figure), ground


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
    given = walks((0, 0), (10, 4))
    view = view_of(given, GAPPED.bounds)
    for axes in ground_figure(given, GAPPED, GAPPED.compiled()).axes[:2]:
        (picture,) = axes.images
        assert picture.get_extent() == [view.x_min, view.x_max, view.y_min, view.y_max]
        assert (axes.get_aspect(), picture.origin) == (1.0, "lower")
        np.testing.assert_array_equal(axes.lines[0].get_xydata(), [(0, 0), (10, 4)])


def test_on_random_ground_the_first_episode_alone_is_drawn():
    (svg, ground), (other, _) = (
        section(RANDOM, walks((-9.5, 0), (-6, 0)), episodes)
        for episodes in (EPISODES, EPISODES[::-1])
    )
    pictures = [re.search(r'href="(data:image/png[^"]*)"', each)[1] for each in (svg, other)]
    assert ground == "random" and pictures[0] != pictures[1]
    same, ground = section(GAPPED, walks((-9.5, 0), (-6, 0)))
    assert ground == "same"
    # one path less of each of two controllers
    assert same.count("stroke-width: 0.9") == svg.count("stroke-width: 0.9") + 2


@pytest.mark.parametrize(("config", "episodes"), [(RANDOM, ()), (Flat(), EPISODES)])
def test_flat_ground_and_one_that_is_not_known_are_not_drawn(config, episodes):
    svg, ground = section(config, walks((0, 0), (10, 4)), episodes)
    assert ground == "none"
    assert "<image" not in svg


def test_who_did_not_walk_has_no_panel():
    svg, _ = section(GAPPED, {"zero": [], **walks((0, 0), (10, 4))})
    assert {"cpg", "hybrid"} <= set(texts(svg))
    assert "zero" not in texts(svg)
    assert section(GAPPED, {"zero": []}) == (None, "none")


def test_titles_of_paths_are_not_cut_off():
    svg = svg_text(aligned_figure(walks((0, 0), (10, 4)), "flat"))
    (y,) = re.findall(r'y="([\d.]+)"[^>]*>cpg', svg)
    assert float(y) > 9  # its baseline; a line has 10 points


def test_things_are_where_props_start_and_as_wide_and_results_of_old_have_none():
    (thing,) = things_of({"props": [5.0, 1.0, 2.0, *NOWHERE]}, PROTOCOL)
    assert (thing.place.tolist(), *thing[1:]) == ([5.0, 1.0], 0.5, (0.2, 0.4, 0.6))
    _, box = things_of({"props": [5.0, 1.0, 2.0, 0.0, 9.0, 1.0]}, PROTOCOL)
    assert (box.place.tolist(), *box[1:]) == ([0.0, 9.0], 3.0, (0.0, 0.0, 0.0))
    assert things_of({"goal": [1.0, 2.0]}, {}) == []


def test_things_are_drawn_on_the_map():
    things = [Thing(np.array([3.0, 1.0]), 0.5, (0.2, 0.4, 0.6))]
    own = [dataclasses.replace(each, things=things) for each in walks((0, 0), (10, 4))["cpg"]]
    given = {"cpg": own}
    flat, ground = aligned_figure(given, "flat"), ground_figure(given, GAPPED, GAPPED.compiled())
    for figure in (flat, ground):
        assert "#336699" in svg_text(figure)  # 0.2, 0.4, 0.6 as hexadecimal


def opacity(config, *places, view=VIEW):
    """Of the picture of the ground at places, mm."""
    picture = ground_picture(config, config.draw(config.seed), view)[..., 3]
    share = (np.array(places) - (view.x_min, view.y_min)) / (
        view.x_max - view.x_min,
        view.y_max - view.y_min,
    )
    columns, rows = (share * picture.T.shape).astype(int).T
    return picture[rows, columns].tolist()


def test_gaps_are_bare_and_the_higher_the_ground_the_stronger_its_shade():
    # slabs of 1 mm start at -10 mm, with 0.3 mm between them
    assert opacity(GAPPED, (-9.5, 0), (-8.85, 0), (-8.5, 0)) == [0.15, 0, 0.15]
    # blocks of 1.1 * 1.3 mm at a pitch of 1.3 mm; the first stands out, its neighbours do not
    assert opacity(Blocks(), (-9.4, -19.4), (-8.1, -19.4)) == [0.5, 0.15]
    assert 0.15 <= opacity(HILLS, (0, 0))[0] <= 0.5
    assert len(np.unique(ground_picture(HILLS, HILLS.draw(0), VIEW)[..., 3])) == LEVELS
