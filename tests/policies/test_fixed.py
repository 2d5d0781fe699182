"""Policies that were not learned, against numbers worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.policies import (
    ClosedLoop,
    OpenLoop,
    Pursuit,
    Relaxed,
    UnhurriedPursuit,
    WormCPG,
    WormReflex,
)
from flyrl.policies.fixed import FunctionPolicy
from flyrl.policies.laws import fixed_policy
from flyrl.tasks import TASKS, Neurons
from tests.policies.conftest import observed, walked

TURN = np.pi / 4
SLIGHTLY = np.array([np.cos(0.1), np.sin(0.1)])
UNITS = np.array([20.0, 10.0])
"""mm/s and rad/s of a command."""


@pytest.mark.parametrize(
    ("policy", "settings", "name", "terms", "expected"),
    [
        (
            Pursuit,
            {},
            "path",
            {"target_direction": [(1, 0), SLIGHTLY, SLIGHTLY * (1, -1), (0, 1), (0, -1)]},
            [(1.0, 1.0), (0.9, 1.1), (1.1, 0.9), (0.2, 1.2), (1.2, 0.2)],
        ),
        # goals ahead, left and right of a fly at (1, 2) that faces y
        (
            Pursuit,
            {},
            "target_goal",
            {
                "achieved_goal": (1.0, 2.0),
                "desired_goal": [(1.0, 5.0), (0.0, 2.0), (3.0, 2.0)],
                "compass": (0.0, 1.0),
            },
            [(1.0, 1.0), (0.2, 1.2), (1.2, 0.2)],
        ),
        # 3 mm ahead, moving to the left, to the right, and ahead, at 20 mm/s
        (
            Pursuit,
            {"lead": 0.15},
            "chase",
            {
                "target_direction": (1, 0),
                "target_distance": 3 / 15,
                "target_velocity": [(0, 1), (0, -1), (1, 0)],
            },
            [(1 - TURN, 1.2), (1.2, 1 - TURN), (1.0, 1.0)],
        ),
        # of 3 s, 0.6 are kept for turns, and a drive of 1 brings the fly ahead by 8 mm/s: 17.8 mm
        # from being reached, 8 mm, and 8 mm that lie to the left; then 8 mm in 1 s, and in 0.6
        (
            UnhurriedPursuit,
            {},
            "target",
            {
                "target_direction": [(1, 0), (1, 0), (0, 1), (1, 0), (0, 1)],
                "target_distance": np.array([[18.8], [9], [9], [9], [9]]) / 15,
                "time_left": np.array([[3.0], [3], [3], [1.6], [1.2]]) / 3,
            },
            [(17.8 / 2.4 / 8,) * 2, (0.8, 0.8), (0.0, 1.0), (1.0, 1.0), (0.0, 1.3)],
        ),
        (
            OpenLoop,
            {},
            "velocity",
            {"command": np.array([(13.0, 0.0), (6.5, 0.0), (6.5, 3.2), (0.0, -3.2)]) / UNITS},
            [(1.0, 1.0), (0.5, 0.5), (0.0, 1.0), (0.5, -0.5)],
        ),
        # the second lacks 2.6 mm/s and 0.64 rad/s: 1.3 mm/s more, and 1.28 rad/s to the left
        (
            ClosedLoop,
            {"speed_gain": 0.5, "yaw_gain": 2.0},
            "velocity",
            {
                "command": (6.5, 0.0) / UNITS,
                "mean_velocity": np.array([(6.5, 0.0), (3.9, -0.64)]) / UNITS,
            },
            [(0.5, 0.5), (0.6 - 0.2, 0.6 + 0.2)],
        ),
    ],
)
def test_drives_by_hand(policy, settings, name, terms, expected):
    task = TASKS[name]()
    made, observations = policy(task, **settings), observed(task, len(expected), **terms)
    actions = made.predict(observations)[0]
    np.testing.assert_allclose(task.actions.commands(actions), expected, rtol=1e-6, atol=1e-6)
    for observation, action in zip(observations, actions, strict=True):
        np.testing.assert_array_equal(made.predict(observation)[0], action)


# ------------------------------------------------------------------ functions


def test_a_function_gets_the_time_since_each_episode_started():
    task = TASKS["target"]()
    policy = FunctionPolicy(lambda time_s, shown: (time_s, 1.0), task)
    observation, state = observed(task, 2), None
    for starts in ([True, True], [False, False], [False, True]):
        actions, state = policy.predict(observation, state, np.array(starts))
    drives = task.actions.commands(actions)
    np.testing.assert_allclose(drives, [[0.04, 1.0], [0.0, 1.0]], atol=1e-6)


@pytest.mark.parametrize("name", ["target", "hybrid_turning", "target_goal"])
def test_a_function_gets_the_observation_by_the_names_of_its_terms(name):
    task, given = TASKS[name](), {}
    policy = FunctionPolicy(lambda time_s, shown: given.update(shown) or (1.0, 1.0), task)
    values = np.arange(sum(term.size for term in task.observation))
    goals = {"achieved_goal": values[:2], "desired_goal": values[2:4], "observation": values[4:]}
    policy.predict(goals if task.has_goals else values)
    assert [*given] == [term.name for term in task.observation]
    for term in task.observation:
        place = task.slices()[term.name]
        np.testing.assert_array_equal(given[term.name], values[place].reshape(term.shape))


@pytest.mark.parametrize("flies", [(), (1,), (3,)])
def test_observations_with_rows_and_columns_are_those_of_one_fly_or_of_a_batch(flies):
    task = TASKS["hybrid_turning"]()
    observation = {term.name: np.zeros((*flies, *term.shape)) for term in task.observation}
    actions, _ = fixed_policy("constant(1.0, 0.4)", task).predict(observation)
    np.testing.assert_allclose(
        task.actions.commands(actions), np.broadcast_to([1.0, 0.4], (*flies, 2)), atol=1e-6
    )


def test_of_a_worm_a_function_returns_the_action():
    task = TASKS["worm_crawl_box"]()
    half = np.full(task.actions.size, 0.5)
    action, _ = FunctionPolicy(lambda time_s, shown: half, task).predict(observed(task)[0])
    np.testing.assert_array_equal(action, half)


def test_another_number_of_values_is_refused():
    task = TASKS["target"]()
    with pytest.raises(ValueError, match="must return 2 numbers"):
        FunctionPolicy(lambda time_s, shown: 1.0, task).predict(observed(task))


# ------------------------------------------------------------------ worms

BLIND = np.zeros((1, 3))
HALF = {"frequency_hz": 2.0, "waves": 0.4, "amplitude": 0.5}
"""A wave that recruits whole pools, and holds them for no time."""


def worm(*pools, is_integer=True):
    """A task for a worm with such muscles, all with 16 neurons unless told otherwise."""
    actions = Neurons(pools or (16,) * 10, is_integer)
    return replace(TASKS["worm_hang"](), actions=actions, decision_interval_s=0.05)


def test_a_relaxed_worm_recruits_no_neuron_but_the_first():
    whole, _ = Relaxed(worm(16, 5)).predict(BLIND[0])
    np.testing.assert_array_equal(whole, [0, 0])
    assert whole.dtype == np.int64
    box, state = Relaxed(worm(16, 5, is_integer=False)).predict(np.zeros((3, 7)), "kept")
    np.testing.assert_array_equal(box, -np.ones((3, 2)))
    assert box.dtype == np.float32
    assert state == "kept"


@pytest.mark.parametrize("is_integer", [True, False])
def test_the_settled_cpg_by_hand(is_integer):
    """After 2.05 s at 2 Hz the first phase is at 36 deg, and each one is 0.4 / 5 turns behind.

    A half of 1 + sin 36 deg = 1.588 is 11.9 of the 15 neurons beyond the first, and so on.
    """
    task = worm(is_integer=is_integer)
    actions, (_, magnitudes) = walked(WormCPG(task, **HALF), [BLIND] * 41)
    np.testing.assert_allclose(magnitudes, 0.5)
    first, second = task.actions.commands(actions)[-1, 0].reshape(5, 2).T
    assert first.tolist() == [12, 8, 5, 2, 0]
    assert second.tolist() == [3, 7, 10, 13, 15]


def test_a_cpg_starts_softly():
    # after 50 steps of 1 ms at 20 / s the magnitude is 0.5 (1 - 0.98 ** 50) = 0.318
    action, (_, magnitudes) = WormCPG(worm(), **HALF).predict(BLIND)
    np.testing.assert_allclose(magnitudes, 0.5 * (1 - 0.98**50))
    assert action[0, :2].tolist() == [8, 2]


def test_a_larger_amplitude_recruits_no_more_than_the_pool():
    actions, _ = walked(WormCPG(worm(), amplitude=2.0), [BLIND] * 30)
    assert (actions.min(), actions.max()) == (0, 15)


def test_rows_of_a_cpg_are_those_of_single_worms_and_their_episodes():
    policy = WormCPG(worm())
    starts = np.zeros((12, 3), dtype=bool)
    starts[[4, 9], [0, 2]] = True
    together, state = walked(policy, [np.zeros((3, 4))] * 12, starts)
    for row in range(3):
        alone, _ = walked(policy, [np.zeros(4)] * 12, starts[:, row])
        np.testing.assert_array_equal(together[:, row], alone)
    assert (together[4, 0] != together[4, 1]).any()
    before = [part.copy() for part in state]
    policy.predict(np.zeros((3, 4)), state)
    np.testing.assert_array_equal(state, before)


def test_the_reflex_by_hand():
    """With 0.05 s and 4 per rad and s, 1 rad too little adds a fifth of the pool of 15."""
    task = worm(*(16,) * 4)
    errors = (-1.0, -1.0, 0.0, 1.0, 3.0, -50.0)
    starts = [[False, step == 1] for step in range(6)]
    bent = [observed(task, 2, bend_error=error) for error in errors]
    actions, share = walked(WormReflex(task, gain=4.0), bent, starts)
    # shares 0.2, 0.4, 0.4, 0.2, -0.4 and at most 1, of both joints alike
    first, second = [3, 6, 6, 3, 0, 15], [0, 0, 0, 0, 6, 0]
    np.testing.assert_array_equal(actions[:, 0], np.stack([first, second] * 2, axis=1))
    # an episode that starts with the second
    first, second = [3, 3, 3, 0, 0, 15], [0, 0, 0, 0, 9, 0]
    np.testing.assert_array_equal(actions[:, 1], np.stack([first, second] * 2, axis=1))
    assert share.tolist() == [1.0, 1.0]


def test_the_reflex_bends_a_worm_to_either_side_as_told():
    env = BatchedEnv(EnvConfig("worm_hang"), 2)
    policy = WormReflex(env.task)
    drawn = env.config.sample_episode(0)
    bends = [replace(drawn, joint_angles=(), command=(bend,)) for bend in (0.6, -0.6)]
    observation, state = env.reset(episodes=bends), None
    for _ in range(40):
        action, state = policy.predict(observation, state)
        transition = env.step(action)
        observation = transition.observation
    np.testing.assert_allclose(env.state.bend, [0.6, -0.6], atol=0.1)
    assert transition.is_success.tolist() == [True, True]
    # back and belly: the first of two antagonists, and the second
    assert (env.state.neurons[0, ::2] > env.state.neurons[0, 1::2]).all()
    assert (env.state.neurons[1, ::2] < env.state.neurons[1, 1::2]).all()


def test_a_worm_crawls_with_the_cpg_and_not_relaxed():
    env = BatchedEnv(EnvConfig("worm_crawl"), 2)
    straight = replace(env.config.sample_episode(0), spawn_yaw=0.0, joint_angles=())
    observation, state = env.reset(episodes=[straight] * 2), None
    policies = WormCPG(env.task), Relaxed(env.task)
    for _ in range(40):
        wave, state = policies[0].predict(observation, state)
        rest, _ = policies[1].predict(observation)
        observation = env.step(np.stack([wave[0], rest[1]])).observation
    waving, resting = env.state.position_w[:, 0]
    assert waving > 8.0
    assert abs(resting) < 0.01
    np.testing.assert_allclose(
        env.task_state().totals["progress"], env.state.position_w[:, 0], atol=1e-9
    )
