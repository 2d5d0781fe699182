"""Steering crossed with legs."""

from dataclasses import asdict

import numpy as np
import pytest

from flyrl.evaluation.contrast import crossing, success_by_kind
from flyrl.evaluation.episodes import episode_row, episode_table
from flyrl.tasks.episode import FIRST_GROUND_SEED
from flyrl.terrains import AnyGround
from tests.synthetic import TASK, judged_by, make_record

# successes of eight episodes
WALKED = {
    "pursuit": "11111111",
    "pursuit@cpg": "11110000",
    "zero": "00000000",
    "zero@cpg": "11000000",
    "hybrid": "00000000",
}
LEGS = {"pursuit": "hybrid", "pursuit@cpg": "cpg", "zero": "hybrid", "zero@cpg": "cpg"}
PROTOCOL = {
    **judged_by(TASK),
    "entrants": [
        {
            "name": name,
            "leg_controller": LEGS.get(name, "hybrid"),
            "policy": name.removesuffix("@cpg"),
            "sha256": None,
        }
        for name in WALKED
    ],
}


def rows(names):
    return episode_table(
        [
            episode_row(
                make_record(
                    [[0, 0], [1, 0]],
                    controller=name,
                    index=i,
                    outcome="success" if each == "1" else "timeout",
                ),
                "",
            )
            for name in names
            for i, each in enumerate(WALKED[name])
        ]
    )


@pytest.fixture(scope="module")
def crossed():
    return crossing(rows(WALKED), PROTOCOL, np.random.default_rng(0))


def test_what_stands_on_one_pair_of_legs_alone_is_left_out(crossed):
    assert {steering: list(group) for steering, group in crossed.items()} == {
        "pursuit": ["hybrid", "cpg"],
        "zero": ["hybrid", "cpg"],
    }


def test_legs_are_compared_under_the_same_steering(crossed):
    assert crossed["pursuit"]["hybrid"].of_legs is None
    assert crossed["pursuit"]["cpg"].of_legs.value == -0.5
    assert crossed["zero"]["cpg"].of_legs.value == 0.25


def test_steering_is_compared_on_the_same_legs(crossed):
    assert crossed["pursuit"]["cpg"].of_steering is None
    assert crossed["zero"]["hybrid"].of_steering.value == -1.0
    assert crossed["zero"]["cpg"].of_steering.value == -0.25


def test_the_rate_has_the_interval_of_all_rates(crossed):
    rate = crossed["pursuit"]["cpg"].success
    assert rate.value == 0.5
    assert rate.low == pytest.approx(0.2152, abs=1e-4)  # Wilson: 4 of 8


def test_without_other_legs_there_is_nothing_to_cross():
    assert not crossing(rows(["pursuit", "hybrid"]), PROTOCOL, np.random.default_rng(0))


def test_success_is_told_kind_by_kind_of_ground():
    walked = rows(["pursuit@cpg"])
    ground = AnyGround(kinds=("flat", "blocks"))
    kinds = [ground.kind(FIRST_GROUND_SEED + seed) for seed in walked["seed"]]
    expected = {
        kind: np.mean(
            [each for each, at in zip(walked["success"], kinds, strict=True) if at == kind]
        )
        for kind in kinds
    }
    found = success_by_kind(walked, asdict(ground))["pursuit@cpg"]
    assert {kind: rate.value for kind, rate in found.items()} == expected
    assert len(expected) == 2


def test_ground_of_one_kind_is_not_divided():
    assert success_by_kind(rows(["pursuit"]), {"name": "blocks"}) == {}
