import numpy as np
import pytest

from flyrl.evaluation.seeds import PROFILE_AT, seed_groups

RATES = {"a": (1.0, 0.8), "b": (0.6, 0.4), "c": (0.2, 0.0)}


def entrant(name, seed, rate=1e-3, terrain="flat", policy="learned with ppo on flat"):
    """A learned entrant as a protocol has it."""
    training = {"algo": "ppo", "seed": seed, "settings": {"algo": {"learning_rate": rate}}}
    trained_in = {"terrain": {"name": terrain}}
    return {
        "name": name,
        "kind": "learned",
        "policy": policy,
        "training": training,
        "trained_in": trained_in,
    }


def summary(rates):
    return [
        {"terrain": terrain, "controller": name, "success_rate": {"value": pair[i]}}
        for i, terrain in enumerate(("flat", "mixed"))
        for name, pair in rates.items()
    ]


def test_policies_of_one_training_are_a_group():
    entrants = [entrant("a", 0), entrant("b", 1), entrant("c", 0, rate=1e-2)]
    first, second = seed_groups(entrants, summary(RATES))
    assert first.names == ("a", "b")
    assert first.terrains == ("flat", "mixed")
    np.testing.assert_array_equal(first.scores, [[1.0, 0.8], [0.6, 0.4]])
    assert second.names == ("c",)


def test_groups_of_the_same_name_are_told_apart():
    entrants = [entrant("a", 0), entrant("b", 1, rate=1e-2), entrant("c", 2, 0.1, policy="other")]
    labels = [group.label for group in seed_groups(entrants, summary(RATES))]
    assert labels == ["learned with ppo on flat (a)", "learned with ppo on flat (b)", "other"]


def test_where_it_was_trained_makes_another_group():
    entrants = [entrant("a", 0), entrant("b", 1, terrain="blocks")]
    assert len(seed_groups(entrants, summary(RATES))) == 2


def test_fixed_controllers_and_policies_of_unknown_training_stand_alone():
    unknown = [{**entrant(name, 0), "training": {"algo": "ppo"}} for name in "ab"]
    fixed = {"name": "c", "kind": "fixed", "policy": "constant drive (1, 1)"}
    groups = seed_groups([*unknown, fixed], summary(RATES))
    assert [group.names for group in groups] == [("a",), ("b",)]


def test_who_is_missing_on_a_terrain_is_left_out():
    rows = [row for row in summary(RATES) if (row["terrain"], row["controller"]) != ("mixed", "b")]
    (group,) = seed_groups([entrant("a", 0), entrant("b", 1)], rows)
    assert group.names == ("a",)


def test_figures_over_seeds():
    rates = {name: (0.1 * i, 0.2) for i, name in enumerate("abcdefgh")}
    entrants = [entrant(name, i) for i, name in enumerate(rates)]
    (group,) = seed_groups(entrants, summary(rates))
    flat, mixed = group.on_each(np.random.default_rng(0))
    # of 0 ... 0.7 the middle half
    assert flat.value == pytest.approx(0.35)
    assert flat.low < 0.35 < flat.high
    assert mixed.reason == "all runs are equal"
    profile = group.profile(np.random.default_rng(0))
    at_half = profile[PROFILE_AT.index(0.5)]
    assert at_half.value == pytest.approx(3 / 16)
