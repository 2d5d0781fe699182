"""Trainings over their seeds, and from terrain to terrain."""

from dataclasses import asdict

import numpy as np
import pytest

from flyrl.evaluation.trainings import (
    PROFILE_AT,
    generalisation,
    is_same_ground,
    over_seeds,
    trainings,
)
from flyrl.terrains import TERRAINS, Blocks

FLAT, BLOCKS = TERRAINS["flat"], TERRAINS["blocks"]


def entrant(name, terrain, seed=0, **changes):
    """A learned entrant as a protocol has it."""
    return {
        "name": name,
        "kind": "learned",
        "policy": f"learned on {terrain.label}",
        "source": f"runs/{name}/best.safetensors",
        "trained_in": {"terrain": asdict(terrain)},
        "training": {"algo": "ppo", "seed": seed, "settings": {}},
        **changes,
    }


def row(name, terrain, successes, episodes=10, advance=None):
    return {
        "controller": name,
        "terrain": terrain,
        "episodes": episodes,
        "successes": successes,
        "success_rate": {"value": successes / episodes},
        "metrics": {"advance_mm": {"mean": advance}},
    }


def matrix(entrants, summary, terrains=(FLAT, BLOCKS), task="target"):
    protocol = {
        "task": task,
        "entrants": entrants,
        "terrains": [{"name": t.label, "config": asdict(t)} for t in terrains],
    }
    return generalisation(protocol, summary, np.random.default_rng(0))


TWO = [entrant("a", BLOCKS), entrant("b", FLAT)]
TWO_ROWS = [row("a", "flat", 5), row("a", "blocks", 8), row("b", "flat", 10), row("b", "blocks", 0)]


def test_a_row_per_training_and_a_column_per_terrain():
    found = matrix(TWO, TWO_ROWS)
    assert found["terrains"] == ("flat", "blocks")
    assert [each["terrain"] for each in found["rows"]] == ["blocks", "flat"]
    values = [[cell["success"].value for cell in each["cells"]] for each in found["rows"]]
    assert values == [[0.5, 0.8], [1.0, 0.0]]
    # the terrain of the training is marked
    homes = [[cell["is_home"] for cell in each["cells"]] for each in found["rows"]]
    assert homes == [[False, True], [True, False]]
    # trainings of a terrain stand together
    third = entrant("c", BLOCKS, policy="another way", training={"algo": "sac", "settings": {}})
    rows = matrix([*TWO, third], TWO_ROWS)["rows"]
    assert [each["names"][0] for each in rows] == ["a", "c", "b"]


def test_a_policy_on_other_legs_is_no_other_seed_of_its_training():
    legs = [entrant(f"a@{each}", FLAT) for each in ("hybrid", "cpg")]
    assert [each["names"] for each in matrix(legs, TWO_ROWS)["rows"]] == [("a@hybrid",), ("a@cpg",)]


def test_a_few_seeds_have_the_rate_of_all_their_episodes():
    pair = [entrant("a", FLAT, 0), entrant("b", FLAT, 1)]
    found = matrix(pair, [row("a", "flat", 10), row("b", "flat", 4), row("a", "blocks", 1)])
    (training,) = found["rows"]
    assert training["names"] == ("a", "b")
    flat, blocks = (cell["success"] for cell in training["cells"])
    assert (flat.value, flat.n) == (0.7, 20)
    # Wilson by hand: (14 + z²/2) / (20 + z²) ± z / (20 + z²) sqrt(14 * 6 / 20 + z²/4), z = 1.96
    assert (flat.low, flat.high) == pytest.approx((0.481, 0.855), abs=1e-3)
    # who is missing does not count
    assert (blocks.value, blocks.n) == (0.1, 10)


def test_five_seeds_have_their_interquartile_mean():
    successes = (0, 5, 6, 8, 10)
    names = "abcde"
    entrants = [entrant(name, FLAT, seed) for seed, name in enumerate(names)]
    summary = [row(name, "flat", n) for name, n in zip(names, successes, strict=True)]
    summary += [row(name, "blocks", 3) for name in names]
    flat, blocks = (cell["success"] for cell in matrix(entrants, summary)["rows"][0]["cells"])
    # a quarter of five is one on either side
    assert flat.value == pytest.approx((0.5 + 0.6 + 0.8) / 3)
    assert flat.low < flat.value < flat.high
    assert (blocks.value, blocks.reason) == (pytest.approx(0.3), "all runs are equal")


def test_where_success_says_little_there_is_a_second_figure():
    pair = [entrant("a", FLAT, 0), entrant("b", FLAT, 1)]
    ways = {("a", "flat"): 4.0, ("b", "flat"): 7.0, ("a", "blocks"): 2.0, ("b", "blocks"): None}
    summary = [row(*place, 0, advance=way) for place, way in ways.items()]
    found = matrix(pair, summary, task="traverse")
    assert found["second"] == "advance_mm"
    assert [cell["second"] for cell in found["rows"][0]["cells"]] == [5.5, 2.0]
    assert matrix(pair, summary)["second"] is None


def test_one_terrain_is_nothing_to_compare():
    mine, rows = [entrant("b", FLAT)], [row("b", "flat", 1)]
    assert matrix(mine, rows, terrains=(FLAT,)) is None
    assert matrix(TWO, TWO_ROWS, terrains=(FLAT,)) is not None
    (training,) = matrix(mine, rows)["rows"]
    assert training["cells"][1]["success"].value is None  # nobody walked there


@pytest.mark.parametrize("trained_in", [{}, {"terrain": {"name": "ice"}}, {"terrain": ["flat"]}])
def test_a_policy_of_unknown_terrain_is_left_out(trained_in):
    assert matrix([entrant("a", FLAT, trained_in=trained_in)], TWO_ROWS) is None


DRAWN = {"height_range": (0.15, 0.45)}


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (BLOCKS, Blocks(seed=3), True),  # nothing is drawn
        (BLOCKS, Blocks(height_range=(0.3, 0.3)), False),
        (TERRAINS["random_blocks"], Blocks(seed=5, random=True, **DRAWN), True),
        (Blocks(seed=4, **DRAWN), Blocks(seed=5, **DRAWN), False),
    ],
)
def test_settings_without_effect_make_no_other_ground(one, other, same):
    assert is_same_ground(one, other) is same


def member(name, seed, rate=1e-3, policy="learned with ppo on flat"):
    """A learned entrant whose training has settings."""
    training = {"algo": "ppo", "seed": seed, "settings": {"algo": {"learning_rate": rate}}}
    return entrant(name, FLAT, policy=policy, training=training)


def of_seeds(*entrants, rates, missing=()):
    """Success over seeds on flat and mixed ground, given the success rates on both by name."""
    rows = [
        row(name, terrain, rate, episodes=1)
        for name, pair in rates.items()
        for terrain, rate in zip(("flat", "mixed"), pair, strict=True)
        if (name, terrain) != missing
    ]
    return over_seeds(entrants, rows, np.random.default_rng(0))


A, B = member("a", 0), member("b", 1)


def test_policies_of_one_training_are_a_group():
    rates = {"a": (1.0, 0.8), "b": (0.6, 0.4), "c": (0.2, 0.0), "d": (0.0, 0.0)}
    others = member("c", 0, rate=1e-2), member("d", 2)
    found = of_seeds(A, B, *others, rates=rates, missing=("d", "mixed"))
    assert found["terrains"] == ["flat", "mixed"]
    # who is missing on a terrain is left out
    assert [each["names"] for each in found["rows"]] == [["a", "b"], ["c"]]
    # the middle half of two is their mean, of four the middle two
    first = found["rows"][0]
    means = [cell.value for cell in (*first["cells"], first["overall"])]
    assert means == pytest.approx([0.8, 0.6, 0.7])
    assert of_seeds(A, rates=rates) is None  # one seed alone


def test_trainings_of_the_same_name_are_told_apart():
    found = trainings([A, member("b", 1, 1e-2), member("c", 2, 0.1, "other")])
    assert [*found] == ["learned with ppo on flat (a)", "learned with ppo on flat (b)", "other"]


def test_fixed_controllers_and_policies_of_unknown_training_stand_alone():
    unknown = [{**each, "training": {"algo": "ppo"}} for each in (A, B)]
    fixed = {"name": "c", "kind": "fixed", "policy": "constant drive (1, 1)"}
    assert [*trainings([*unknown, fixed]).values()] == [("a",), ("b",)]


def test_figures_over_seeds():
    rates = {name: (0.1 * i, 0.2) for i, name in enumerate("abcdefgh")}
    found = of_seeds(*(member(name, i) for i, name in enumerate(rates)), rates=rates)
    flat, mixed = found["rows"][0]["cells"]
    # of 0 ... 0.7 the middle half
    assert flat.value == pytest.approx(0.35)
    assert flat.low < 0.35 < flat.high
    assert mixed.reason == "all runs are equal"
    (profile,) = found["profiles"].values()
    assert profile[PROFILE_AT.index(0.5)].value == pytest.approx(3 / 16)
