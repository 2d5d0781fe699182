import numpy as np
import pytest

from flyrl.evaluation.rows import episode_row, episode_table
from flyrl.evaluation.summary import find_leaders
from tests.synthetic import make_record


def rows(controller, times, terrain="flat"):
    """A row per episode: its time to goal, s, or None without success."""
    return [
        episode_row(
            make_record(
                [(0, 0), (1, 0)],
                controller=controller,
                terrain=terrain,
                index=index,
                outcome="timeout" if time is None else "success",
                duration_s=3.0 if time is None else time,
            )
        )
        for index, time in enumerate(times)
    ]


def leaders(*given):
    table = episode_table([row for own in given for row in own])
    return find_leaders(table, 3.0, np.random.default_rng(0))


def test_success_decides():
    (leader,) = leaders(rows("slow", [2.9] * 6), rows("quick", [0.1, *[None] * 5]))
    assert leader.names == ("slow",)
    assert (leader.metric, leader.value, leader.next_value) == ("success", 1, pytest.approx(1 / 6))
    assert leader.next_name == "quick"
    assert leader.difference.value == pytest.approx(5 / 6)
    assert leader.difference.low > 0


def test_of_equal_success_time_decides():
    (leader,) = leaders(
        rows("slow", [2.0, 2.1, 2.2, 2.3, 2.4]), rows("quick", [1.0, 1.2, 1.1, 1.3, 1.5])
    )
    assert (leader.names, leader.next_name, leader.metric) == (
        ("quick",), "slow", "time_to_goal_s"
    )  # fmt: skip
    assert leader.difference.high < 0


def test_who_cannot_be_told_apart_shares_the_first_place():
    one, other = rows("one", [1, 2, 1, 2, 1, 2]), rows("other", [2, 1, 2, 1, 2, 1])
    (leader,) = leaders(one, other, rows("none", [None] * 6))
    assert set(leader.names) == {"one", "other"}
    assert (leader.metric, leader.value, leader.next_name) == ("success", 1, "none")
    assert not leader.is_alone


def test_a_difference_that_is_always_the_same_is_one():
    (leader,) = leaders(rows("all", [1.0] * 5), rows("none", [None] * 5))
    assert leader.is_alone
    assert leader.difference.low is None


def test_four_episodes_decide_nothing():
    (leader,) = leaders(rows("all", [1.0] * 4), rows("none", [None] * 4))
    assert leader.names == ("all", "none")
    assert leader.difference is None


def test_each_terrain_has_its_own():
    found = leaders(
        rows("one", [1.0] * 5), rows("other", [None] * 5),
        rows("one", [None] * 5, "gapped"), rows("other", [1.0] * 5, "gapped"),
    )  # fmt: skip
    assert [(leader.terrain, leader.names) for leader in found] == [
        ("flat", ("one",)), ("gapped", ("other",)),
    ]  # fmt: skip


def test_each_condition_has_its_own():
    usual = [*rows("one", [1.0] * 5), *rows("other", [None] * 5)]
    table = [
        *({**row, "condition": "push=0"} for row in usual),
        *({**row, "condition": "push=8"} for row in rows("one", [None] * 5)),
        *({**row, "condition": "push=8"} for row in rows("other", [None] * 5)),
    ]
    found = leaders(table)
    assert [(leader.condition, leader.names) for leader in found] == [
        ("push=0", ("one",)), ("push=8", ("one", "other")),
    ]  # fmt: skip


def test_one_alone_is_the_best_without_a_next():
    (leader,) = leaders(rows("one", [1.0] * 5))
    assert (leader.names, leader.next_name) == (("one",), None)


def test_traverse_is_decided_by_the_way():
    far = [
        {**row, "task": "traverse", "advance_mm": 9.0 + row["episode"]}
        for row in rows("far", [None] * 5)
    ]
    near = [{**row, "task": "traverse", "advance_mm": 5.0} for row in rows("near", [1.0] * 5)]
    (leader,) = leaders(near, far)
    assert (leader.names, leader.metric) == (("far",), "advance_mm")


def test_a_difference_below_the_smallest_effect_is_level():
    quick, slow = rows("quick", [1.00] * 6), rows("slow", [1.04] * 6)
    table = episode_table([*quick, *slow])
    for effect, names in ((0.1, ("quick", "slow")), (0.01, ("quick",))):
        (leader,) = find_leaders(table, 3.0, np.random.default_rng(0), {"time_to_goal_s": effect})
        assert leader.names == names
