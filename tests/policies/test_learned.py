from dataclasses import replace

import numpy as np
import pytest

from flyrl.policies import LearnedPolicy, PolicyFileError
from flyrl.policies.networks import Normaliser
from flyrl.tasks import TASKS, Drives, Neurons, ObservationTerm, Task
from tests.policies.conftest import walked

STRETCHED = {"squashing": "tanh", "action_low": (-0.5, -0.5), "action_high": (1.5, 1.5)}
TANH_OUTPUTS = np.tanh(0.25) + np.array([0.5, -np.tanh(1.2)])
NORMALISER = Normaliser(np.array([1, 0, 0]), np.array([16.0, 4, 1]), 1e-12, 10.0)


@pytest.mark.parametrize(
    ("kind", "changes", "observation", "expected"),
    [
        # hidden = relu([0.25, 2*0.1 + 1]) = [0.25, 1.2]; output = [0.25 + 0.5, 0.25 - 1.2]
        ("bundle", {}, [0.25, 0.1, 9.0], [0.75, -0.95]),
        ("bundle", {}, [5.0, 50.0, 0.0], [1, -1]),
        ("bundle", STRETCHED, [0.25, 0.1, 9.0], 0.5 + np.tanh([0.75, -0.95])),
        ("bundle", {"activation": "tanh"}, [0.25, 0.1, 9.0], TANH_OUTPUTS),
        # the network sees [0.25, 0.1, 9]
        ("bundle", {"normaliser": NORMALISER}, [2.0, 0.2, 9.0], [0.75, -0.95]),
        # outputs = [0.5, 0.25, 1.2] for 0, 1, 2 and [0.5, 1.2] for -1, 0
        ("choosing", {}, [0.25, 0.1, 9.0], [2, 0]),
        # of equal outputs, the first: [0.5, 0.5, 0] and [1, 0]; [0.5, 0.5, 1] and [1, 1]
        ("choosing", {}, [0.5, -0.5, 0.0], [0, -1]),
        ("choosing", {}, [0.5, 0.0, 0.0], [2, -1]),
    ],
)
def test_action_by_hand(kind, changes, observation, expected, request):
    policy = LearnedPolicy(replace(request.getfixturevalue(kind), **changes))
    action, state = policy.predict(observation, state="kept")
    np.testing.assert_allclose(action, expected, rtol=1e-6)
    assert action.dtype == (np.int64 if kind == "choosing" else np.float32)
    assert state == "kept"


def test_an_episode_starts_without_memory(recurrent):
    policy = LearnedPolicy(recurrent)
    observations = np.random.default_rng(0).normal(size=(3, 2, 3))
    _, state = walked(policy, observations)
    assert state[0].shape == state[1].shape == (2, 2, 3)
    before = [part.copy() for part in state]
    fresh, _ = policy.predict(observations[0])
    kept, _ = policy.predict(observations[0], state)
    mixed, _ = policy.predict(observations[0], state, np.array([True, False]))
    np.testing.assert_array_equal(mixed, [fresh[0], kept[1]])
    assert np.abs(kept[0] - fresh[0]).max() > 1e-3
    np.testing.assert_array_equal(state, before)  # nor is it changed in place


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
        LearnedPolicy(request.getfixturevalue(kind), task)


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ([("bearing", 2), ("height", 1)], r"does not show: speed \(1 values\), here it is missing"),
        ([("speed", 1), ("bearing", 3)], r"bearing \(2 values\), here it is bearing \(3 values\)"),
    ],
)
def test_a_task_that_does_not_show_what_was_learned_on_is_refused(bundle, terms, message):
    with pytest.raises(PolicyFileError, match=message):
        LearnedPolicy(bundle, _task(*terms))


def test_a_policy_takes_its_terms_out_of_what_a_task_shows(bundle):
    seen = np.random.default_rng(0).normal(size=(4, 3))
    shown = np.insert(seen[:, [2, 0, 1]], [0, 1, 3], 9.0, axis=1)  # 9, speed, 9, bearing, 9
    task = _task(("height", 1), ("speed", 1), ("tilt", 1), ("bearing", 2), ("odour", 1))
    expected, _ = LearnedPolicy(bundle).predict(seen)
    actions, _ = LearnedPolicy(bundle, task).predict(shown)
    np.testing.assert_array_equal(actions, expected)
