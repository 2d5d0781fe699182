"""The task with goals, against numbers worked out by hand."""

import dataclasses

import numpy as np
import pytest

from flyrl.tasks import TASKS, RewardTerm, extended
from flyrl.tasks.target import compute_reward, compute_terminated, is_reached
from flyrl.tasks.task import as_observed
from flyrl.tasks.terms import failure_info
from tests.tasks.test_terms import fly_state, task_state, turned

TARGET_GOAL = TASKS["target_goal"]()
# 5, 0.9 and 1.1 mm apart
ACHIEVED = [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]
DESIRED = [[0.3, 0.4], [1.09, 1.0], [1.0, 1.11]]
NO_FAILURE = {"is_failure": False, "decisions_lost": 0.0}
FAILURES_OF_TWO = [
    {"is_failure": True, "decisions_lost": 10.0},
    {"is_failure": True, "decisions_lost": 20.0},
    NO_FAILURE,
]
DENSE = extended(TARGET_GOAL, {}, {"away": -3.0, "distance": -0.1})


def test_a_goal_is_reached_within_1_mm() -> None:
    assert is_reached(ACHIEVED, DESIRED, 1.0).tolist() == [False, True, False]
    assert not is_reached(ACHIEVED[0], DESIRED[0], 1.0)


@pytest.mark.parametrize(
    ("task", "info", "expected"),
    [
        (TARGET_GOAL, NO_FAILURE, [-1, 0, -1]),
        (DENSE, NO_FAILURE, [-3.5, -0.09, -3.11]),
        # a failure is charged for the decisions lost, whatever the goal
        (TARGET_GOAL, FAILURES_OF_TWO, [-1 - 10, -20, -1]),
        (DENSE, FAILURES_OF_TWO, [-3 - 11 * 0.5 - 10, -21 * 0.09 - 20, -3.11]),
    ],
)
def test_the_reward_of_goals_is_weighed_as_the_tables(task, info, expected) -> None:
    np.testing.assert_allclose(compute_reward(task, ACHIEVED, DESIRED, info), expected)


def test_a_failure_costs_what_waiting_in_its_place_would() -> None:
    weights = {term.name: term.weight for term in TARGET_GOAL.reward}
    assert weights["lost_time"] == weights["away"] < 0
    # 5 mm from the target, with 100 decisions left
    state = task_state(fly_state(rotation_w=turned(roll=np.pi)), goal=[[3, 4]])
    values = {term.name: float(term.compute(state)[0]) for term in TARGET_GOAL.reward}
    assert values == pytest.approx({"away": 1, "distance": 101 * 5, "lost_time": 100})


def test_reaching_a_goal_is_an_end_and_so_is_a_failure() -> None:
    ends = compute_terminated(TARGET_GOAL, ACHIEVED, DESIRED, NO_FAILURE)
    assert ends.tolist() == [False, True, False]
    # a failure in the last decision before the time limit costs no more, and ends all the same
    late = {"is_failure": [True, False, True], "decisions_lost": np.zeros(3)}
    assert compute_terminated(TARGET_GOAL, ACHIEVED, DESIRED, late).tolist() == [True, True, True]


def test_infos_are_one_dict_or_many() -> None:
    expected = compute_reward(DENSE, ACHIEVED, DESIRED, FAILURES_OF_TWO)
    columns = {key: [info[key] for info in FAILURES_OF_TWO] for key in NO_FAILURE}
    for infos in (columns, np.array(FAILURES_OF_TWO)):
        assert compute_reward(DENSE, ACHIEVED, DESIRED, infos).tolist() == expected.tolist()
    for i, info in enumerate(FAILURES_OF_TWO):
        assert compute_reward(DENSE, ACHIEVED[i], DESIRED[i], info) == expected[i]
        ends = compute_terminated(DENSE, ACHIEVED[i], DESIRED[i], info)
        assert ends == (i < 2)
    grid = np.array([FAILURES_OF_TWO, FAILURES_OF_TWO])
    rewards = compute_reward(DENSE, [ACHIEVED, ACHIEVED], [DESIRED, DESIRED], grid)
    assert rewards.tolist() == [expected.tolist()] * 2


@pytest.mark.parametrize("info", [None, {}, [{}, {}, {}], {"outcome": "fall"}])
def test_infos_that_do_not_tell_of_failures_are_refused(info) -> None:
    with pytest.raises(ValueError, match=r"info must .* 'decisions_lost' .*copy_info_dict=True"):
        compute_reward(TARGET_GOAL, ACHIEVED, DESIRED, info)
    with pytest.raises(ValueError, match=r"info must .* 'is_failure'"):
        compute_terminated(TARGET_GOAL, ACHIEVED, DESIRED, info)


def test_goals_are_places_in_units_of_10_mm() -> None:
    state = task_state(fly_state(position_w=[[1.0, -2.0, 0.5]]), goal=[[15.0, 5.0]])
    achieved, desired = (
        as_observed(t.compute(state), t.low, t.high) for t in TARGET_GOAL.observation[:2]
    )
    np.testing.assert_allclose(achieved, [[0.1, -0.2]], rtol=1e-6)
    np.testing.assert_allclose(desired, [[1.5, 0.5]], rtol=1e-6)


def test_rewards_of_the_table_are_those_of_the_goals_shown() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-20, 20, (1000, 3))
    goal = places[:, :2] + rng.normal(size=(1000, 2))
    # those beyond x = -10 have left the arena
    state = task_state(fly_state(1000, position_w=places), goal=goal)
    achieved, desired = (
        as_observed(t.compute(state), t.low, t.high) for t in TARGET_GOAL.observation[:2]
    )
    lost = failure_info(state)["decisions_lost"]
    for term in TARGET_GOAL.reward:
        assert np.ptp(term.compute(state)) > 0
        np.testing.assert_array_equal(term.compute(state), term.of_goals(achieved, desired, lost))


def test_a_reward_that_does_not_follow_from_goals_is_refused_by_name() -> None:
    speed = RewardTerm("speed", 1.0, lambda state: state.fly.velocity_w[:, 0], "mm/s")
    task = extended(TARGET_GOAL, {"mine:SPEED": speed}, {})
    with pytest.raises(ValueError, match="'speed' of target_goal does not follow from the goals"):
        compute_reward(task, ACHIEVED, DESIRED, NO_FAILURE)


def test_goals_must_come_first() -> None:
    with pytest.raises(ValueError, match=r"first terms are 'achieved_goal'.* got \('desired_goal'"):
        dataclasses.replace(TARGET_GOAL, observation=TARGET_GOAL.observation[1:])
