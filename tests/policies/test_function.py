"""Functions of time and observation as policies."""

import numpy as np
import pytest

from flyrl.policies.function import FunctionPolicy, takes
from flyrl.tasks import TASKS, task_named

TARGET = TASKS["target"]()
NUM_INPUTS = sum(term.size for term in TARGET.observation)


def by_time(time_s, observation):
    return time_s, 1.0


def test_a_function_gets_the_time_since_each_episode_started():
    policy = FunctionPolicy(by_time, TARGET)
    observation = np.zeros((2, NUM_INPUTS))
    _, state = policy.predict(observation, None, np.array([True, True]))
    _, state = policy.predict(observation, state, np.array([False, False]))
    actions, _ = policy.predict(observation, state, np.array([False, True]))
    drives = TARGET.actions.commands(actions)
    np.testing.assert_allclose(drives, [[0.04, 1.0], [0.0, 1.0]], atol=1e-6)


def test_a_function_gets_the_observation_by_the_names_of_its_terms():
    seen = []

    def law(time_s, observation):
        seen.append(observation)
        return 1.0, 1.0

    FunctionPolicy(law, TARGET).predict(np.arange(NUM_INPUTS))
    assert list(seen[0]) == [term.name for term in TARGET.observation]
    for name, place in TARGET.slices().items():
        np.testing.assert_array_equal(seen[0][name].ravel(), np.arange(NUM_INPUTS)[place])
    assert [values.shape for values in seen[0].values()] == [
        term.shape for term in TARGET.observation
    ]


def test_goals_are_observations_like_others():
    task = TASKS["target_goal"]()
    seen = []

    def law(time_s, observation):
        seen.append(observation)
        return 1.0, 1.0

    sizes = {"achieved_goal": 2, "desired_goal": 2}
    rest = sum(term.size for term in task.observation) - 4
    observation = {name: np.full(size, i) for i, (name, size) in enumerate(sizes.items())}
    FunctionPolicy(law, task).predict({**observation, "observation": np.full(rest, 7.0)})
    np.testing.assert_array_equal(seen[0]["achieved_goal"], [0, 0])
    np.testing.assert_array_equal(seen[0]["desired_goal"], [1, 1])


def test_of_a_worm_a_function_returns_the_action():
    task = task_named("worm_crawl_box")
    size = task.actions.size
    policy = FunctionPolicy(lambda time_s, seen: np.full(size, 0.5), task)
    action, _ = policy.predict(np.zeros(sum(term.size for term in task.observation)))
    np.testing.assert_array_equal(action, np.full(size, 0.5))


def test_another_number_of_values_is_refused():
    with pytest.raises(ValueError, match="must return 2 numbers"):
        FunctionPolicy(lambda time_s, seen: 1.0, TARGET).predict(np.zeros(NUM_INPUTS))


def test_functions_are_told_apart_by_their_arguments():
    assert takes(by_time, 2)
    assert not takes(by_time, 1)
    assert takes(lambda task: 0, 1)
    assert takes(lambda task, speed=1.0: 0, 1)
    assert not takes(lambda time_s, seen, more: 0, 2)


def test_terms_of_a_dict_observation_come_under_their_own_names():
    task = TASKS["hybrid_turning"]()
    seen = []

    def law(time_s, observation):
        seen.append(observation)
        return 1.0, 1.0

    row = np.zeros(sum(term.size for term in task.observation))
    row[task.slices()["joints"]] = 7.0
    FunctionPolicy(law, task).predict(row)
    assert {name for name, values in seen[0].items() if values.any()} == {"joints"}
    assert (seen[0]["joints"] == 7.0).all()
