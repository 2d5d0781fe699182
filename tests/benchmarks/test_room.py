"""Room between the best law and what planning on the simulation reaches."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.room.__main__ import main, measure, table
from benchmarks.room.figure import verdict
from benchmarks.room.law import NUM_LAWS, score, stages
from benchmarks.room.luck import Disturbed, disturbed, summary
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


@pytest.mark.parametrize("foresees", [True, False])
def test_only_a_planner_that_foresees_acts_on_the_command_after_this_one(foresees):
    config = EnvConfig(
        task={"name": "velocity", "command_time": 0.2, "on_command": 0.1, "time_limit": 0.4},
        terrain="flat",
        physics="fast",
    )
    env = BatchedEnv(config, 1, num_threads=1)
    first_actions = []
    for next_speed in (2.0, 12.0):
        planner = Planner(env, ConstantDrive(1.0, 1.0, env.task), PlannerConfig(foresees=foresees))
        episode = replace(config.sample_episode(3), command=(6.0, 0.0, next_speed, 0.0))
        first_actions.append(planner.predict(env.reset(episodes=[episode]))[0])
    assert np.array_equal(*first_actions) != foresees


def test_a_law_is_better_by_its_successes_and_then_by_its_time():
    quick, slow = (
        make_record(np.zeros((11, 2)), outcome="success", duration_s=time) for time in (1.0, 2.0)
    )
    failed = make_record(np.zeros((11, 2)), outcome="fall", duration_s=0.1)
    assert score([quick]) > score([slow]) > score([failed])
    assert score([quick, failed]) == pytest.approx((1 - 0.1 / 3 - 0.1) / 2)


def test_a_third_of_the_laws_walks_on_for_twice_as_many_episodes():
    assert stages(NUM_LAWS) == [(24, 8), (8, 16), (3, 32)]
    assert sum(count * episodes for count, episodes in stages(192)) == 3936


def test_fewer_laws_than_are_known_are_refused_before_anything_walks(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(
        "sys.argv", ["room", "any", "--laws", "3", "--output", f"{tmp_path}/room.json"]
    )
    with pytest.raises(SystemExit):
        main()
    assert "--laws: 3; allowed: 4 or more" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_how_many_laws_were_tuned_is_recorded_only_where_the_published_one_fails():
    near = replace(CONFIG, task={"name": "target", "bearing": 0.0, "distance": [2.0, 2.0]})
    assert "laws" not in measure(near, [near.sample_episode(3)])


def success(**wins):
    """Successes of 20 episodes by who walked; a number is of those won, the first ones."""
    return {
        who: {"success": [i < won for i in range(20)] if isinstance(won, int) else won}
        for who, won in wins.items()
    }


def test_the_table_has_the_room_above_the_better_law_and_the_share_that_a_policy_closes():
    row = success(published=[1, 0, 0, 0], tuned=[1, 1, 0, 0], bound=[1, 1, 1, 0])
    rates, room, found = (
        table({"blocks": row}).splitlines()[2].split("|")[i].strip() for i in (5, 6, 7)
    )
    assert (rates.split()[0], room, found) == ("75%", "25%", "room")
    row["learned"] = success(
        published=[1, 1, 0, 0, 0, 0], tuned=[0, 1, 0, 0, 0, 0], policy=[1, 1, 1, 1, 0, 0]
    )
    _, _, *shown, _ = table({"blocks": row}).splitlines()[-1].split("|")
    # 1 / 3 of the 5 / 12 that the better law of these six leaves to the bound, and of the 2 / 3
    # that it leaves to the bound or the policy, which wins the fourth
    assert [each.split()[0] for each in shown] == ["33%", "67%", "+33%", "80%", "50%"]


def test_a_policy_may_have_walked_fewer_episodes_than_the_bound():
    row = success(published=[0, 0, 0, 0], tuned=[0, 0, 0, 0], bound=[0, 1, 0, 1])
    row["learned"] = success(published=[0, 0], tuned=[0, 0], policy=[1, 0])
    *_, room, possible, _ = table({"blocks": row}).splitlines()[-1].split("|")
    # its 1 / 2 of 1 / 2, and of 3 / 4: it wins the first
    assert (room.strip(), possible.strip()) == ("100%", "67%")


HALF = [True] * 10 + [False] * 10


@pytest.mark.parametrize(
    ("wins", "expected"),
    [
        ({"published": 10, "tuned": 20, "bound": 20}, "law"),
        ({"published": 20, "tuned": 10, "bound": 20}, "law"),
        ({"published": 2, "tuned": 2, "bound": 3}, "nothing"),
        ({"published": 2, "tuned": 10, "bound": 15, "robust": 13}, "room"),
        ({"published": 2, "tuned": 10, "bound": 20, "robust": 12}, "luck"),
        # on the same episodes as the robust bound the law wins all
        ({"published": HALF, "tuned": HALF, "bound": 20, "robust": [True] * 10}, "luck"),
    ],
)
def test_what_the_room_is(wins, expected):
    assert verdict(success(**wins)) == expected


def test_a_disturbance_is_drawn_anew_by_every_decision_and_stays_within_the_bounds(env):
    low, high = env.task.actions.bounds
    law = ConstantDrive(1.0, 0.5, env.task)
    generator = np.random.default_rng(0)
    policy = Disturbed(law, low, high, noise=0.1, rng=generator)
    observation = env.reset(episodes=[CONFIG.sample_episode(3)])
    plain, _ = law.predict(observation)
    drawn = np.concatenate([policy.predict(observation)[0] - plain for _ in range(400)])
    assert np.std(drawn, axis=0) == pytest.approx([0.1, 0.1], rel=0.15)
    loud = Disturbed(law, low, high, noise=9.0, rng=generator).predict(observation)[0]
    assert np.all((loud >= low) & (loud <= high))


def test_every_draw_of_a_disturbance_walks_the_same_episodes():
    task = {"name": "target", "bearing": 0.0, "distance": [2.0, 8.0], "time_limit": 0.4}
    env = BatchedEnv(replace(CONFIG, task=task), 2, num_threads=1)
    episodes = [env.config.sample_episode(seed) for seed in (1, 2)]  # the second is too far
    law = ConstantDrive(1.0, 1.0, env.task)
    assert disturbed(env, law, episodes, draws=2, noise=0.0).tolist() == [[True, False]] * 2


def test_what_failed_undisturbed_is_shown_beside_all_that_was_disturbed():
    again = np.array([[1, 0, 1, 0], [1, 1, 1, 0]], bool)
    assert summary(np.array([1, 0, 1, 0], bool), again) == (
        "undisturbed 50%; disturbed 62%, where it failed undisturbed 25%; never 25%"
    )
    assert "none failed" in summary(np.array([True] * 4), again)
