import numpy as np
import pytest

from flyrl.evaluation.rows import episode_row, episode_table
from flyrl.evaluation.summary import paired_values, summarise
from tests.synthetic import make_record


def rows(speeds, controller="cpg", terrain="flat", outcome="timeout"):
    """One row per speed (mm/s), over 3 s."""
    return [
        episode_row(
            make_record(
                [(0, 0), (3 * speed, 0)],
                controller=controller,
                terrain=terrain,
                index=index,
                duration_s=3.0,
                outcome=outcome,
            )
        )
        for index, speed in enumerate(speeds)
    ]


def summary_of(rows, reference="cpg"):
    return summarise(episode_table(rows), reference, 3.0, np.random.default_rng(0))


def pairs(own, others, metric="speed_mm_s"):
    return list(paired_values(episode_table(own), episode_table(others), metric, 3.0))


def test_pairs_are_matched_by_episode_not_by_order():
    own, others = rows([3, 5, 9]), rows([1, 1, 1])
    assert pairs(own[::-1], others) == pytest.approx([8, 4, 2])


def test_unpaired_episodes_are_left_out():
    own, others = rows([3, 5, 9]), rows([1, 1, 1])
    assert pairs(own[1:], others[:2]) == pytest.approx([4])


def test_no_success_counts_the_horizon_as_time_to_goal():
    reached = make_record([(0, 0), (1, 0)], outcome="success", duration_s=1.0)
    fallen = make_record([(0, 0), (1, 0)], outcome="fall", duration_s=0.5)
    assert pairs([episode_row(reached)], [episode_row(fallen)], "time_to_goal_s") == [-2.0]


def test_success_is_compared_as_one_and_zero():
    reached = episode_row(make_record([(0, 0), (1, 0)], outcome="success"))
    fallen = episode_row(make_record([(0, 0), (1, 0)], outcome="fall"))
    assert pairs([reached], [fallen], "success") == [1.0]


def test_summary_is_independent_of_the_order_of_rows():
    given = rows([1, 2, 3, 4, 5, 6], "cpg") + rows([2, 2, 2, 2, 2, 9], "hybrid")
    one = summary_of(given)
    given[:6] = given[5::-1]
    other = summary_of(given)
    assert one[0]["metrics"] == other[0]["metrics"]
    difference = [row[1]["paired"]["differences"]["speed_mm_s"]["value"] for row in (one, other)]
    assert difference[0] == pytest.approx(difference[1])


def test_summary_has_a_row_per_terrain_and_controller():
    given = [
        row
        for terrain in ("flat", "gapped")
        for name in ("cpg", "hybrid")
        for row in rows([1, 2], name, terrain)
    ]
    summary = summary_of(given)
    assert [(row["terrain"], row["controller"]) for row in summary] == [
        ("flat", "cpg"),
        ("flat", "hybrid"),
        ("gapped", "cpg"),
        ("gapped", "hybrid"),
    ]


def test_reference_is_not_compared_with_itself():
    given = rows([1, 2], "cpg") + rows([3, 5], "hybrid")
    own, other = summary_of(given)
    assert own["paired"] is None
    assert other["paired"]["reference"] == "cpg"
    assert other["paired"]["differences"]["speed_mm_s"]["value"] == pytest.approx(2.5)


def test_summary_counts_outcomes():
    given = rows([1, 2], outcome="success") + [
        {**row, "episode": row["episode"] + 2} for row in rows([1], outcome="fall")
    ]
    (summary,) = summary_of(given)
    assert summary["successes"] == 2
    assert summary["outcomes"] == {
        "success": 2, "timeout": 0, "fall": 1, "left_arena": 0, "unstable": 0,
    }  # fmt: skip


def test_unknown_reference():
    with pytest.raises(ValueError, match=r"reference.*cpg.*'hybrid'"):
        summary_of(rows([1]), "hybrid")


def test_an_episode_walked_twice():
    with pytest.raises(ValueError, match="twice"):
        summary_of(rows([1]) + rows([2]))


def test_the_better_one_is_the_quicker_one():
    quick = [
        episode_row(make_record([(0, 0), (1, 0)], index=i, outcome="success", duration_s=1 + i / 9))
        for i in range(6)
    ]
    slow = [{**row, "controller": "hybrid", "time_to_goal_s": 2.9} for row in quick]
    _, other = summary_of(quick + slow)
    time = other["paired"]["differences"]["time_to_goal_s"]
    assert time["value"] > 0
    assert time["improvement"]["value"] == 0


def test_p_values_are_corrected_over_all_terrains_and_controllers():
    given = [
        row
        for terrain in ("flat", "gapped")
        for name, gain in (("cpg", 0), ("hybrid", 1), ("rule_based", 0.1))
        for row in rows([1 + gain, 2, 3 + gain, 4 - gain, 5, 6 + gain], name, terrain)
    ]
    summary = summary_of(given)
    family = [row["paired"]["differences"]["speed_mm_s"] for row in summary if row["paired"]]
    assert len(family) == 4
    # all four alike in signs: 16 sets of 4 signs, of which 2 + 8 have a mean as far from 0
    assert {entry["p_value"] for entry in family} == {family[0]["p_value"]}
    assert all(entry["p_adjusted"] == entry["p_value"] for entry in family)


def test_an_interaction_is_the_difference_of_differences():
    """Episode by episode, in mm along +x: (own changed - own usual) - (the same of the other)."""
    ways = {
        ("cpg", "push=0"): [10, 20, 30, 40, 50, 60],
        ("cpg", "push=8"): [8, 17, 26, 35, 44, 53],  # -2, -3, -4, -5, -6, -7
        ("hybrid", "push=0"): [11, 21, 31, 41, 51, 61],
        ("hybrid", "push=8"): [10, 19, 30, 37, 50, 55],  # -1, -2, -1, -4, -1, -6
    }
    given = [
        {**row, "task": "traverse", "condition": condition, "advance_mm": float(way)}
        for (name, condition), own in ways.items()
        for row, way in zip(rows([1] * 6, name), own, strict=True)
    ]
    # walked under one condition alone: no pair
    lone = {**given[-1], "episode": 99, "advance_mm": 1000.0}
    vary = {"push": (0, 8)}
    random = np.random.default_rng(0)
    summary = summarise(episode_table([*given[::-1], lone]), "cpg", 3.0, random, vary)
    found = {(row["controller"], row["condition"]): row["paired"] for row in summary}
    assert "interactions" not in found["hybrid", "push=0"]
    (interaction,) = found["hybrid", "push=8"]["interactions"].items()
    metric, told = interaction
    # 1, 1, 3, 1, 5, 1
    assert (metric, told["n"], told["value"]) == ("advance_mm", 6, 2.0)
    assert 1.0 <= told["low"] < 2.0 < told["high"] <= 5.0


def test_an_interaction_without_pairs_has_none():
    given = [
        {**row, "condition": condition}
        for name, condition in (("cpg", "push=0"), ("cpg", "push=8"), ("hybrid", "push=8"))
        for row in rows([1] * 6, name)
    ]
    random = np.random.default_rng(0)
    *_, hybrid = summarise(episode_table(given), "cpg", 3.0, random, {"push": (0, 8)})
    assert hybrid["paired"]["interactions"]["success"]["reason"] == "no pairs"
