from dataclasses import replace

import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, PolicyFileError
from flyrl.policies.networks import Normaliser
from flyrl.tasks import TASKS, Drives, Neurons, ObservationTerm, Task


def test_action_by_hand(bundle):
    # hidden = relu([0.25, 2*0.1 + 1]) = [0.25, 1.2]; output = [0.25 + 0.5, 0.25 - 1.2]
    action, state = LearnedPolicy(bundle).predict([0.25, 0.1, 9.0], state="kept")
    np.testing.assert_allclose(action, [0.75, -0.95], rtol=1e-6)
    assert action.dtype == np.float32
    assert state == "kept"


def test_action_is_clipped(bundle):
    action, _ = LearnedPolicy(bundle).predict([5.0, 50.0, 0.0])
    np.testing.assert_array_equal(action, [1, -1])


def test_squashed_action_by_hand(bundle):
    policy = LearnedPolicy(
        replace(bundle, squashing="tanh", action_low=(-0.5, -0.5), action_high=(1.5, 1.5))
    )
    action, _ = policy.predict([0.25, 0.1, 9.0])
    np.testing.assert_allclose(action, 0.5 + np.tanh([0.75, -0.95]), rtol=1e-6)


def test_whole_numbers_by_hand(choosing):
    # hidden = [0.25, 1.2]; outputs = [0.5, 0.25, 1.2] for 0, 1, 2 and [0.5, 1.2] for -1, 0
    action, _ = LearnedPolicy(choosing).predict([0.25, 0.1, 9.0])
    np.testing.assert_array_equal(action, [2, 0])
    assert action.dtype == np.int64


def test_of_equal_outputs_the_first_number_is_taken(choosing):
    # hidden = [0.5, 0]; outputs = [0.5, 0.5, 0] and [1, 0]; then [0.5, 1], [0.5, 0.5, 1], [1, 1]
    actions, _ = LearnedPolicy(choosing).predict([[0.5, -0.5, 0.0], [0.5, 0.0, 0.0]])
    np.testing.assert_array_equal(actions, [[0, -1], [2, -1]])


@pytest.mark.parametrize("kind", ["bundle", "choosing"])
def test_single_and_batch_give_the_same_bits(kind, request):
    policy = LearnedPolicy(request.getfixturevalue(kind))
    observations = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    batch, _ = policy.predict(observations)
    singles = [policy.predict(observation)[0] for observation in observations]
    assert batch.shape == (50, 2)
    assert (batch.min(axis=0) < batch.max(axis=0)).all()
    np.testing.assert_array_equal(batch, singles)


def test_observations_are_normalised_first(bundle):
    normaliser = Normaliser(np.array([1, 0, 0]), np.array([16.0, 4, 1]), 1e-12, 10.0)
    action, _ = LearnedPolicy(replace(bundle, normaliser=normaliser)).predict([2.0, 0.2, 9.0])
    # the network sees [0.25, 0.1, 9], as in the test by hand
    np.testing.assert_allclose(action, [0.75, -0.95], rtol=1e-6)


def _walk(policy, observations):
    state, actions = None, []
    for rows in observations:
        action, state = policy.predict(rows, state)
        actions.append(action)
    return np.array(actions), state


def test_a_recurrent_policy_remembers(recurrent):
    policy = LearnedPolicy(recurrent)
    observation = np.array([0.3, -0.2, 0.5])
    (first, second), _ = _walk(policy, [observation] * 2)
    assert np.abs(second - first).max() > 1e-3


def test_memory_in_a_batch_is_that_of_each_alone(recurrent):
    policy = LearnedPolicy(recurrent)
    observations = np.random.default_rng(0).normal(size=(10, 7, 3)).astype(np.float32)
    together, state = _walk(policy, observations)
    assert state[0].shape == state[1].shape == (2, 7, 3)
    for i in range(7):
        np.testing.assert_array_equal(_walk(policy, observations[:, i])[0], together[:, i])


def test_an_episode_starts_without_memory(recurrent):
    policy = LearnedPolicy(recurrent)
    observations = np.random.default_rng(0).normal(size=(3, 2, 3))
    _, state = _walk(policy, observations)
    fresh, _ = policy.predict(observations[0])
    kept, _ = policy.predict(observations[0], state)
    mixed, _ = policy.predict(observations[0], state, np.array([True, False]))
    np.testing.assert_array_equal(mixed, [fresh[0], kept[1]])
    assert np.abs(kept[0] - fresh[0]).max() > 1e-3


def test_a_state_is_not_changed_in_place(recurrent):
    policy = LearnedPolicy(recurrent)
    _, state = policy.predict(np.ones((2, 3)))
    before = [part.copy() for part in state]
    policy.predict(np.ones((2, 3)), state, np.array([True, True]))
    np.testing.assert_array_equal(state, before)


def test_states_and_starts_of_other_shapes_are_refused(recurrent):
    policy = LearnedPolicy(recurrent)
    _, state = policy.predict(np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"state of shape .*; allowed: None, or \(2, 2, 5, 3\)"):
        policy.predict(np.ones((5, 3)), state)
    with pytest.raises(ValueError, match=r"episode_start of shape \(3,\); allowed: \(2,\)"):
        policy.predict(np.ones((2, 3)), state, np.ones(3, dtype=bool))


@pytest.mark.parametrize("shape", [(4,), (2, 4), (1, 1, 3), ()])
def test_other_shapes_are_refused(bundle, shape):
    with pytest.raises(ValueError, match=r"allowed: \(3,\) or \(n, 3\)"):
        LearnedPolicy(bundle).predict(np.zeros(shape))


def test_noise_is_refused(bundle):
    with pytest.raises(ValueError, match="deterministic: False"):
        LearnedPolicy(bundle).predict(np.zeros(3), deterministic=False)


def _task(*terms: tuple[str, int]) -> Task:
    observation = tuple(
        ObservationTerm(name, (size,), -1.0, 1.0, lambda state: state.goal, "")
        for name, size in terms
    )
    return replace(TASKS["target"](), name="other", observation=observation)


@pytest.mark.parametrize(
    ("kind", "actions", "message"),
    [
        ("bundle", Drives(-1.0, 1.5), r"\(1\.0, 1\.0\), those of other numbers within .*1\.5\)$"),
        ("bundle", Neurons((3, 2)), r"are numbers within .* those of other whole numbers within"),
        ("choosing", Drives(), r"are whole numbers within .* those of other numbers within"),
        ("choosing", Neurons((3, 2)), r"\(0\.0, -1\.0\) and \(2\.0, 0\.0\), .*\(2\.0, 1\.0\)$"),
        ("choosing", Neurons((3,)), r"\(2\.0, 0\.0\), .*\(0\.0,\) and \(2\.0,\)$"),
    ],
)
def test_other_actions_are_refused(kind, actions, message, request):
    task = replace(_task(("bearing", 2), ("speed", 1)), actions=actions)
    with pytest.raises(PolicyFileError, match=message):
        LearnedPolicy(request.getfixturevalue(kind)).check_task(task)


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ([("bearing", 2), ("height", 1)], r"term 1 was speed \(1 values\).*height \(1 values\)"),
        ([("bearing", 2)], r"of other: term 1 was speed \(1 values\), here it is missing"),
        ([("bearing", 2), ("speed", 1), ("tilt", 2)], r"term 2 was missing"),
    ],
)
def test_other_layouts_are_refused(bundle, terms, message):
    with pytest.raises(PolicyFileError, match=message):
        LearnedPolicy(bundle).check_task(_task(*terms))
