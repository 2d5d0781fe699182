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
    outcomes = {"0": "timeout", "1": "success"}
    records = [
        make_record([[0, 0], [1, 0]], controller=name, index=i, outcome=outcomes[each])
        for name in names
        for i, each in enumerate(WALKED[name])
    ]
    return episode_table([episode_row(record) for record in records])


def test_legs_are_compared_under_the_same_steering_and_steering_on_the_same_legs():
    crossed = crossing(rows(WALKED), PROTOCOL, np.random.default_rng(0))
    # what stands on one pair of legs alone is left out
    assert {steering: list(group) for steering, group in crossed.items()} == {
        "pursuit": ["hybrid", "cpg"],
        "zero": ["hybrid", "cpg"],
    }
    first, on_cpg = crossed["pursuit"].values()
    other, other_on_cpg = crossed["zero"].values()
    assert first["of_legs"] is on_cpg["of_steering"] is None
    assert (on_cpg["of_legs"].value, other_on_cpg["of_legs"].value) == (-0.5, 0.25)
    assert (other["of_steering"].value, other_on_cpg["of_steering"].value) == (-1.0, -0.25)
    assert on_cpg["success"].value == 0.5
    assert on_cpg["success"].low == pytest.approx(0.2152, abs=1e-4)  # Wilson: 4 of 8
    assert not crossing(rows(["pursuit", "hybrid"]), PROTOCOL, np.random.default_rng(0))


def test_success_is_told_kind_by_kind_of_ground():
    walked = rows(["pursuit@cpg"])
    ground = AnyGround(kinds=("flat", "blocks"))
    kinds = [ground.kind(FIRST_GROUND_SEED + seed) for seed in walked["seed"]]
    expected = walked["success"].groupby(kinds).mean().to_dict()
    found = success_by_kind(walked, asdict(ground))["pursuit@cpg"]
    assert {kind: rate.value for kind, rate in found.items()} == expected
    assert len(expected) == 2
    # ground of one kind is not divided
    assert success_by_kind(rows(["pursuit"]), {"name": "blocks"}) == {}
