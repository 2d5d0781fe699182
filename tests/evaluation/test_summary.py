"""Summaries, paired differences, interactions, leaders, and whom the others are compared with."""

import numpy as np
import pytest

from flyrl.evaluation.episodes import episode_row, episode_table
from flyrl.evaluation.summary import best_reference, find_leaders, paired_values, summarise
from tests.synthetic import TASK, judged_by, make_record


def walked(controller, index, terrain="flat", condition="", way_mm=1.0, **fields):
    """Row of an episode of 3 s, or as its fields say."""
    fields = {"controller": controller, "index": index, "terrain": terrain, **fields}
    record = make_record([(0, 0), (way_mm, 0)], **{"duration_s": 3.0, **fields})
    return episode_row(record, condition)


def rows(speeds, controller="cpg", terrain="flat", outcome="timeout"):
    """One row per speed (mm/s), over 3 s."""
    ways = enumerate(3 * speed for speed in speeds)
    return [walked(controller, i, terrain, way_mm=way, outcome=outcome) for i, way in ways]


def timed(controller, times, terrain="flat", condition=""):
    """A row per episode: its time to goal, s, or None without success."""
    ends = [{"outcome": "success", "duration_s": time} if time else {} for time in times]
    return [walked(controller, i, terrain, condition, **end) for i, end in enumerate(ends)]


def summary_of(rows, **protocol):
    protocol = {**judged_by(TASK), "reference": "cpg", **protocol}
    return summarise(episode_table(rows), protocol, np.random.default_rng(0))


def pairs(own, others, metric="speed_mm_s"):
    return list(paired_values(episode_table(own), episode_table(others), metric, 3.0))


def test_pairs_are_matched_by_episode_and_the_unpaired_left_out():
    own, others = rows([3, 5, 9]), rows([1, 1, 1])
    assert pairs(own[::-1], others) == pytest.approx([8, 4, 2])
    assert pairs(own[1:], others[:2]) == pytest.approx([4])


def test_no_success_counts_the_horizon_as_time_to_goal():
    assert pairs(timed("a", [1.0]), timed("b", [None]), "time_to_goal_s") == [-2.0]
    assert pairs(timed("a", [1.0]), timed("b", [None]), "success") == [1.0]


def test_a_row_per_terrain_and_controller_compared_with_the_reference():
    given = [
        row
        for terrain in ("flat", "gapped")
        for name, speeds in (("cpg", [1, 2]), ("hybrid", [3, 5]))
        for row in rows(speeds, name, terrain)
    ]
    summary = summary_of(given)
    assert [(row["terrain"], row["controller"]) for row in summary] == [
        ("flat", "cpg"), ("flat", "hybrid"), ("gapped", "cpg"), ("gapped", "hybrid"),
    ]  # fmt: skip
    assert summary[0]["paired"] is None
    assert summary[1]["paired"]["reference"] == "cpg"
    assert summary[1]["paired"]["differences"]["speed_mm_s"]["value"] == pytest.approx(2.5)


def test_summary_counts_outcomes():
    fallen = [{**row, "episode": 2} for row in rows([1], outcome="fall")]
    (summary,) = summary_of(rows([1, 2], outcome="success") + fallen)
    assert summary["successes"] == 2
    assert summary["outcomes"] == {
        "success": 2, "timeout": 0, "fall": 1, "left_arena": 0, "unstable": 0,
    }  # fmt: skip


def test_what_cannot_be_summarised():
    with pytest.raises(ValueError, match=r"reference.*cpg.*'hybrid'"):
        summary_of(rows([1]), reference="hybrid")
    with pytest.raises(ValueError, match="twice"):
        summary_of(rows([1]) + rows([2]))


def test_the_quicker_one_is_the_better_one():
    _, other = summary_of(timed("cpg", [1.0] * 6) + timed("hybrid", [2.0] * 6))
    time = other["paired"]["differences"]["time_to_goal_s"]
    assert time["value"] > 0
    assert time["improvement"]["value"] == 0


def test_p_values_are_corrected_as_one_family_over_all_terrains():
    given = [
        row
        for terrain, last in (("flat", 4), ("gapped", -3))
        for name, gain in (("cpg", 0), ("hybrid", 1))
        for row in rows([10 + gain * own for own in (1, 2, 3, 4, 5, last)], name, terrain)
    ]
    paired = [row["paired"] for row in summary_of(given)]
    flat, gapped = (pair["differences"]["speed_mm_s"] for pair in paired if pair)
    assert flat["p_value"] < gapped["p_value"] / 2
    assert flat["p_adjusted"] == 2 * flat["p_value"]
    assert gapped["p_adjusted"] == gapped["p_value"]


def test_an_interaction_is_the_difference_of_differences():
    """Episode by episode, in mm along +x: (own changed - own usual) - (the same of the other)."""
    ways = {
        ("cpg", "push=0"): [10, 20, 30, 40, 50, 60],
        ("cpg", "push=8"): [8, 17, 26, 35, 44, 53],  # -2, -3, -4, -5, -6, -7
        ("hybrid", "push=0"): [11, 21, 31, 41, 51, 61],
        ("hybrid", "push=8"): [10, 19, 30, 37, 50, 55],  # -1, -2, -1, -4, -1, -6
    }
    given = [
        {**row, "condition": condition, "advance_mm": float(way)}
        for (name, condition), own in ways.items()
        for row, way in zip(rows([1] * 6, name), own, strict=True)
    ]
    # walked under one condition alone: no pair
    lone = {**given[-1], "episode": 99, "advance_mm": 1000.0}
    summary = summary_of([*given[::-1], lone], vary={"push": (0, 8)}, decisive=["advance_mm"])
    found = {(row["controller"], row["condition"]): row["paired"] for row in summary}
    assert "interactions" not in found["hybrid", "push=0"]
    ((metric, interaction),) = found["hybrid", "push=8"]["interactions"].items()
    # 1, 1, 3, 1, 5, 1
    assert (metric, interaction["n"], interaction["value"]) == ("advance_mm", 6, 2.0)
    assert 1.0 <= interaction["low"] < 2.0 < interaction["high"] <= 5.0
    # of one that was not walked usually there is none
    (*_, alone) = summary_of(
        [row for row in given if (row["controller"], row["condition"]) != ("hybrid", "push=0")],
        vary={"push": (0, 8)},
    )
    assert alone["paired"]["interactions"]["success"]["reason"] == "no pairs"


# ------------------------------------------------------------------ who is best


def leaders(*given, **protocol):
    table = episode_table([row for own in given for row in own])
    return find_leaders(table, {**judged_by(TASK), **protocol}, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("times", "names", "metric", "following"),
    [
        ({"slow": [2.9] * 6, "quick": [0.1, *[None] * 5]}, {"slow"}, "success", "quick"),
        # of equal success, time decides
        (
            {"slow": [2.0, 2.1, 2.2, 2.3, 2.4], "quick": [1.0, 1.2, 1.1, 1.3, 1.5]},
            *({"quick"}, "time_to_goal_s", "slow"),
        ),
        # no significant difference: a shared first place
        (
            {"one": [1, 2, 1, 2, 1, 2], "other": [2, 1, 2, 1, 2, 1], "none": [None] * 6},
            *({"one", "other"}, "success", "none"),
        ),
        # a difference that is always the same is one, but not of four episodes
        ({"all": [1.0] * 5, "none": [None] * 5}, {"all"}, "success", "none"),
        ({"all": [1.0] * 4, "none": [None] * 4}, {"all", "none"}, "success", None),
        ({"alone": [1.0] * 5}, {"alone"}, "success", None),
    ],
)
def test_the_first_metric_that_tells_them_apart_decides(times, names, metric, following):
    (leader,) = leaders(*(timed(name, own) for name, own in times.items()))
    assert (set(leader.names), leader.metric, leader.next_name) == (names, metric, following)


def test_a_leader_has_its_mean_and_its_lead():
    (leader,) = leaders(timed("slow", [2.9] * 6), timed("quick", [0.1, *[None] * 5]))
    assert (leader.value, leader.next_value) == (1, pytest.approx(1 / 6))
    assert leader.difference.value == pytest.approx(5 / 6)
    assert leader.difference.low > 0
    (always,) = leaders(timed("all", [1.0] * 5), timed("none", [None] * 5))
    assert (always.difference.value, always.difference.low) == (1, None)


def test_each_terrain_and_each_condition_has_its_own():
    won, lost = [1.0] * 5, [None] * 5
    found = leaders(
        timed("one", won, "flat", "push=0"), timed("other", lost, "flat", "push=0"),
        timed("one", lost, "flat", "push=8"), timed("other", lost, "flat", "push=8"),
        timed("one", lost, "gapped", "push=0"), timed("other", won, "gapped", "push=0"),
    )  # fmt: skip
    assert [(leader.terrain, leader.condition, leader.names) for leader in found] == [
        ("flat", "push=0", ("one",)),
        ("flat", "push=8", ("one", "other")),
        ("gapped", "push=0", ("other",)),
    ]


def test_the_task_says_what_decides():
    far = [{**row, "advance_mm": 9.0 + row["episode"]} for row in timed("far", [None] * 5)]
    near = [{**row, "advance_mm": 5.0} for row in timed("near", [1.0] * 5)]
    (leader,) = leaders(near, far, decisive=["advance_mm"])
    assert (leader.names, leader.metric) == (("far",), "advance_mm")


@pytest.mark.parametrize(("effect", "names"), [(0.1, ("quick", "slow")), (0.01, ("quick",))])
def test_a_difference_below_the_smallest_effect_is_level(effect, names):
    effects = {"time_to_goal_s": effect}
    (leader,) = leaders(
        timed("quick", [1.00] * 6), timed("slow", [1.04] * 6), smallest_effects=effects
    )
    assert leader.names == names


@pytest.mark.parametrize(
    ("successes", "expected"),
    [
        ({"cpg": 9, "hybrid": 5, "pursuit": 3}, "pursuit"),  # the one that sees the target
        ({"zero": 0, "cpg": 5, "hybrid": 9}, "hybrid"),  # none sees it: the best
    ],
)
def test_the_reference_is_the_best_fixed_entrant_that_sees_what_is_asked(successes, expected):
    entrants = [
        {"name": name, "kind": "fixed", "sees": ["target_direction"] * (name == "pursuit")}
        for name in successes
    ]
    entrants.append({"name": "mine", "kind": "learned"})
    given = [timed(name, [1.0] * n + [None] * (10 - n)) for name, n in successes.items()]
    table = episode_table([row for own in (*given, timed("mine", [1.0] * 10)) for row in own])
    assert best_reference(table, {**judged_by(TASK), "entrants": entrants}) == expected
