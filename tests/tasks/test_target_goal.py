"""The task with goals, against numbers worked out by hand."""

import dataclasses

import numpy as np
import pytest

from flyrl.tasks import RewardTerm, extended
from flyrl.tasks.target_goal import TARGET_GOAL, is_reached
from tests.tasks.test_terms import fly_state, task_state

# 5, 0.9 and 1.1 mm apart
ACHIEVED = [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]
DESIRED = [[0.3, 0.4], [1.09, 1.0], [1.0, 1.11]]


def test_a_goal_is_reached_within_1_mm() -> None:
    assert is_reached(ACHIEVED, DESIRED).tolist() == [False, True, False]
    assert not is_reached(ACHIEVED[0], DESIRED[0])


def test_the_reward_of_goals_is_weighed_as_the_tables() -> None:
    assert TARGET_GOAL.compute_reward(ACHIEVED, DESIRED).tolist() == [-1, 0, -1]
    task = extended(TARGET_GOAL, {}, {"away": -3.0, "distance": -0.1})
    rewards = task.compute_reward(ACHIEVED, DESIRED)
    np.testing.assert_allclose(rewards, [-3.5, -0.09, -3.11])


def test_goals_are_places_in_units_of_10_mm() -> None:
    state = task_state(fly_state(position_w=[[1.0, -2.0, 0.5]]), goal=[[15.0, 5.0]])
    achieved, desired = (t.shown(t.compute(state)) for t in TARGET_GOAL.observation[:2])
    np.testing.assert_allclose(achieved, [[0.1, -0.2]], rtol=1e-6)
    np.testing.assert_allclose(desired, [[1.5, 0.5]], rtol=1e-6)


def test_rewards_of_the_table_are_those_of_the_goals_shown() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-20, 20, (1000, 3))
    goal = places[:, :2] + rng.normal(size=(1000, 2))
    state = task_state(fly_state(1000, position_w=places), goal=goal)
    achieved, desired = (t.shown(t.compute(state)) for t in TARGET_GOAL.observation[:2])
    for term in TARGET_GOAL.reward:
        assert np.ptp(term.compute(state)) > 0
        np.testing.assert_array_equal(term.compute(state), term.of_goals(achieved, desired))


def test_a_reward_that_does_not_follow_from_goals_is_refused_by_name() -> None:
    speed = RewardTerm("speed", 1.0, lambda state: state.fly.velocity_w[:, 0], "mm/s")
    task = extended(TARGET_GOAL, {"mine:SPEED": speed}, {})
    with pytest.raises(ValueError, match="'speed' of target_goal does not follow from the goals"):
        task.compute_reward(ACHIEVED, DESIRED)


def test_goals_must_come_first() -> None:
    with pytest.raises(ValueError, match=r"first terms are 'achieved_goal'.* got \('desired_goal'"):
        dataclasses.replace(TARGET_GOAL, observation=TARGET_GOAL.observation[1:])
