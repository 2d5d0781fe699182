"""Room between the best law and what planning on the simulation reaches."""

import numpy as np
import pytest

from benchmarks.room.__main__ import table
from benchmarks.room.figure import verdict
from benchmarks.room.law import score
from benchmarks.room.planner import Planner, PlannerConfig
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.policies import ConstantDrive
from flyrl.rollouts import run_episodes
from tests.synthetic import make_record

CONFIG = EnvConfig(
    task={"name": "target", "bearing": 0.0, "time_limit": 0.4}, terrain="flat", physics="fast"
)


@pytest.fixture(scope="module")
def env():
    return BatchedEnv(CONFIG, 1, num_threads=1)


def walked(env, policy):
    """mm along +x."""
    (record,) = run_episodes(env, policy, [CONFIG.sample_episode(3)])
    return record.position_w[-1, 0] - record.position_w[0, 0]


def test_without_a_spread_the_planner_follows_its_law_to_the_bit(env):
    law = ConstantDrive(1.0, 0.8, env.task)
    idle = PlannerConfig(candidates=2, rounds=1, best=1, spread=0.0)
    assert walked(env, Planner(env, law, idle)) == walked(env, law)


def test_the_planner_walks_to_a_target_where_its_law_stands(env):
    standing = ConstantDrive(0.0, 0.0, env.task)
    assert abs(walked(env, standing)) < 0.5
    assert walked(env, Planner(env, standing, PlannerConfig(candidates=8, spread=1.0))) > 1.0


def test_a_law_is_better_by_its_successes_and_then_by_its_time():
    quick, slow = (
        make_record(np.zeros((11, 2)), outcome="success", duration_s=time) for time in (1.0, 2.0)
    )
    failed = make_record(np.zeros((11, 2)), outcome="fall", duration_s=0.1)
    assert score([quick]) > score([slow]) > score([failed])
    assert score([quick, failed]) == pytest.approx((1 - 0.1 / 3 - 0.1) / 2)


def test_the_room_is_what_the_bound_has_before_the_better_law():
    rates = {"published": [1, 0, 0, 0], "tuned": [1, 1, 0, 0], "bound": [1, 1, 1, 0]}
    results = {"blocks": {who: {"success": row} for who, row in rates.items()}}
    last = table(results).splitlines()[-1].split("|")
    assert last[1].strip() == "blocks"
    assert last[4].strip() == ""
    assert last[5].strip().startswith("75 [")
    assert last[6].strip() == "25"
    assert last[7].strip() == "room"


def test_a_policy_is_told_beside_the_better_law_and_by_its_share_of_the_room():
    rates = {"published": [1, 0, 0, 0], "tuned": [1, 1, 0, 0], "bound": [1, 1, 1, 1]}
    results = {"blocks": {who: {"success": row} for who, row in rates.items()}}
    longer = {"published": [1, 1, 1, 0, 0, 0], "tuned": [0, 1, 0, 0, 0, 0]}
    longer["policy"] = [1, 1, 1, 1, 0, 0]
    results["blocks"]["learned"] = {who: {"success": row} for who, row in longer.items()}
    *_, law, policy, gain, share, _ = table(results).splitlines()[-1].split("|")
    assert law.strip().startswith("50 [")
    assert policy.strip().startswith("67 [")
    assert gain.strip().startswith("+17")
    # 1 / 6 of 1 / 2
    assert share.strip() == "33 %"


@pytest.mark.parametrize(
    ("wins", "expected"),
    [
        ({"published": 10, "tuned": 20, "bound": 20}, "law"),
        ({"published": 20, "tuned": 10, "bound": 20}, "law"),
        ({"published": 2, "tuned": 2, "bound": 3}, "nothing"),
        ({"published": 2, "tuned": 10, "bound": 15, "robust": 13}, "room"),
        ({"published": 2, "tuned": 10, "bound": 20, "robust": 12}, "luck"),
    ],
)
def test_what_the_room_is(wins, expected):
    row = {who: {"success": [True] * n + [False] * (20 - n)} for who, n in wins.items()}
    assert verdict(row) == expected


def test_a_robust_bound_of_fewer_episodes_meets_the_law_on_the_same():
    # the law wins the first half; so does the bound without luck, which had no more to win
    half = [True] * 10 + [False] * 10
    row = {"published": half, "tuned": half, "bound": [True] * 20, "robust": [True] * 10}
    assert verdict({who: {"success": success} for who, success in row.items()}) == "luck"
