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
from flyrl.tasks import TASKS, Neurons


def _drives(policy, task, **terms):
    """Drives of a policy for observations whose other terms are 9."""
    rows = len(next(iter(terms.values())))
    observations = np.full((rows, sum(term.size for term in task.observation)), 9.0)
    for name, values in terms.items():
        observations[:, task.slices()[name]] = values
    actions = policy.predict(observations)[0]
    for observation, action in zip(observations, actions, strict=True):
        np.testing.assert_array_equal(policy.predict(observation)[0], action)
    return task.actions.commands(actions)


def test_pursuit_turns_towards_the_target():
    task = TASKS["path"]()
    slightly = np.array([np.cos(0.1), np.sin(0.1)])
    towards = [(1, 0), slightly, slightly * (1, -1), (0, 1), (0, -1)]
    drives = _drives(Pursuit(task), task, target_direction=towards)
    expected = [(1.0, 1.0), (0.9, 1.1), (1.1, 0.9), (0.2, 1.2), (1.2, 0.2)]
    np.testing.assert_allclose(drives, expected, rtol=1e-6)


def test_pursuit_of_a_goal_turns_towards_it():
    task = TASKS["target_goal"]()
    goals = [(1.0, 5.0), (0.0, 2.0), (3.0, 2.0)]  # ahead, left and right of a fly at (1, 2)
    facing_y = [(0.0, 1.0)] * 3
    terms = {"achieved_goal": [(1.0, 2.0)] * 3, "desired_goal": goals, "compass": facing_y}
    drives = _drives(Pursuit(task), task, **terms)
    np.testing.assert_allclose(drives, [(1.0, 1.0), (0.2, 1.2), (1.2, 0.2)], rtol=1e-6)


def test_pursuit_with_a_lead_turns_to_where_the_target_will_be():
    task = TASKS["chase"]()
    # 3 mm ahead, moving to the left, to the right, and ahead, at 20 mm/s
    drives = _drives(
        Pursuit(task, lead=0.15), task,
        target_direction=[(1, 0)] * 3, target_distance=[[3 / 15]] * 3,
        target_velocity=[(0, 1), (0, -1), (1, 0)],
    )  # fmt: skip
    turn = np.pi / 4
    expected = [(1 - turn, 1.2), (1.2, 1 - turn), (1.0, 1.0)]
    np.testing.assert_allclose(drives, expected, rtol=1e-6)


def test_unhurried_pursuit_hurries_as_far_as_the_time_asks_for():
    """Of 3 s, 0.6 are kept for turns; a drive of 1 is to bring the fly ahead by 8 mm/s."""
    task = TASKS["target"]()
    # 17.8 mm from being reached, 8 mm, and 8 mm that lie to the left; then 8 mm in 1 s and in 0.6
    ahead, aside = (1, 0), (0, 1)
    drives = _drives(
        UnhurriedPursuit(task), task,
        target_direction=[ahead, ahead, aside, ahead, aside],
        target_distance=np.array([[18.8], [9], [9], [9], [9]]) / 15,
        time_left=np.array([[3.0], [3], [3], [1.6], [1.2]]) / 3,
    )  # fmt: skip
    far = 17.8 / 2.4 / 8
    expected = [(far, far), (0.8, 0.8), (0.0, 1.0), (1.0, 1.0), (0.0, 1.3)]
    np.testing.assert_allclose(drives, expected, rtol=1e-6)


def test_open_loop_answers_speed_and_yaw_rate():
    task = TASKS["velocity"]()
    commands = np.array([(13.0, 0.0), (6.5, 0.0), (6.5, 3.2), (0.0, -3.2)]) / (20.0, 10.0)
    drives = _drives(OpenLoop(task), task, command=commands)
    expected = [(1.0, 1.0), (0.5, 0.5), (0.0, 1.0), (0.5, -0.5)]
    np.testing.assert_allclose(drives, expected, atol=1e-6)


def test_closed_loop_adds_what_speed_and_yaw_rate_lack():
    task = TASKS["velocity"]()
    units = (20.0, 10.0)
    drives = _drives(
        ClosedLoop(task, speed_gain=0.5, yaw_gain=2.0), task,
        command=np.array([(6.5, 0.0), (6.5, 0.0)]) / units,
        mean_velocity=np.array([(6.5, 0.0), (3.9, -0.64)]) / units,
    )  # fmt: skip
    # 1.3 mm/s more, and 1.28 rad/s to the left
    np.testing.assert_allclose(drives, [(0.5, 0.5), (0.6 - 0.2, 0.6 + 0.2)], rtol=1e-6)


# ------------------------------------------------------------------ functions

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


def _shown(task, observation):
    """What a function gets of an observation."""
    given = []

    def law(time_s, shown):
        given.append(shown)
        return 1.0, 1.0

    FunctionPolicy(law, task).predict(observation)
    return given[0]


@pytest.mark.parametrize("name", ["target", "hybrid_turning"])
def test_a_function_gets_the_observation_by_the_names_of_its_terms(name):
    task = TASKS[name]()
    values = np.arange(sum(term.size for term in task.observation))
    shown = _shown(task, values)
    assert [*shown] == [term.name for term in task.observation]
    for term in task.observation:
        place = task.slices()[term.name]
        np.testing.assert_array_equal(shown[term.name], values[place].reshape(term.shape))


def test_goals_are_observations_like_others():
    task = TASKS["target_goal"]()
    rest = sum(term.size for term in task.observation) - 4
    goals = {"achieved_goal": np.zeros(2), "desired_goal": np.ones(2)}
    shown = _shown(task, {**goals, "observation": np.full(rest, 7.0)})
    np.testing.assert_array_equal(shown["achieved_goal"], [0, 0])
    np.testing.assert_array_equal(shown["desired_goal"], [1, 1])


def test_of_a_worm_a_function_returns_the_action():
    task = TASKS["worm_crawl_box"]()
    size = task.actions.size
    policy = FunctionPolicy(lambda time_s, seen: np.full(size, 0.5), task)
    action, _ = policy.predict(np.zeros(sum(term.size for term in task.observation)))
    np.testing.assert_array_equal(action, np.full(size, 0.5))


def test_another_number_of_values_is_refused():
    with pytest.raises(ValueError, match="must return 2 numbers"):
        FunctionPolicy(lambda time_s, seen: 1.0, TARGET).predict(np.zeros(NUM_INPUTS))


# ------------------------------------------------------------------ worms

BLIND = np.zeros((1, 3))
HALF = {"frequency_hz": 2.0, "waves": 0.4, "amplitude": 0.5}
"""A wave that recruits whole pools, and holds them for no time."""


def worm(*pools, interval_s=0.05, is_integer=True):
    """A task for a worm with such muscles, all with 16 neurons unless told otherwise."""
    actions = Neurons(pools or (16,) * 10, is_integer)
    return replace(TASKS["worm_hang"](), actions=actions, decision_interval_s=interval_s)


def acted(policy, observations, starts=None):
    """Actions (T, ...) on one observation after the other, and the last state."""
    state, actions = None, []
    for i, observation in enumerate(observations):
        start = None if starts is None else starts[i]
        action, state = policy.predict(observation, state, start)
        actions.append(action)
    return np.array(actions), state


# ------------------------------------------------------------------ rest


def test_a_relaxed_worm_recruits_no_neuron_but_the_first():
    whole, _ = Relaxed(worm(16, 5)).predict(BLIND[0])
    np.testing.assert_array_equal(whole, [0, 0])
    assert whole.dtype == np.int64
    box, state = Relaxed(worm(16, 5, is_integer=False)).predict(np.zeros((3, 7)), "kept")
    np.testing.assert_array_equal(box, -np.ones((3, 2)))
    assert box.dtype == np.float32
    assert state == "kept"


# ------------------------------------------------------------------ CPG


@pytest.mark.parametrize("is_integer", [True, False])
def test_the_settled_cpg_by_hand(is_integer):
    """After 2.05 s at 2 Hz the first phase is at 36 deg, and each one is 0.4 / 5 turns behind.

    A half of 1 + sin 36 deg = 1.588 is 11.9 of the 15 neurons beyond the first, and so on.
    """
    task = worm(is_integer=is_integer)
    actions, (_, magnitudes) = acted(WormCPG(task, **HALF), [BLIND] * 41)
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
    actions, _ = acted(WormCPG(worm(), amplitude=2.0), [BLIND] * 30)
    assert actions.min() == 0
    assert actions.max() == 15


def test_rows_of_a_cpg_are_those_of_single_worms_and_their_episodes():
    policy = WormCPG(worm())
    starts = np.zeros((12, 3), dtype=bool)
    starts[[4, 9], [0, 2]] = True
    together, state = acted(policy, [np.zeros((3, 4))] * 12, starts)
    for row in range(3):
        alone, _ = acted(policy, [np.zeros(4)] * 12, starts[:, row])
        np.testing.assert_array_equal(together[:, row], alone)
    assert (together[4, 0] != together[4, 1]).any()
    before = [part.copy() for part in state]
    policy.predict(np.zeros((3, 4)), state)
    np.testing.assert_array_equal(state, before)


# ------------------------------------------------------------------ reflex


def _bent(task, errors):
    """Observations with these errors of the bend, rad; their other terms are 9."""
    observations = np.full((len(errors), sum(term.size for term in task.observation)), 9.0)
    observations[:, task.slices()["bend_error"]] = np.reshape(errors, (-1, 1))
    return observations


def test_the_reflex_by_hand():
    """With 0.05 s and 4 per rad and s, 1 rad too little adds a fifth of the pool of 15."""
    task = worm(*(16,) * 4)
    errors = [_bent(task, [error] * 2) for error in (-1.0, -1.0, 0.0, 1.0, 3.0, -50.0)]
    starts = [[False, step == 1] for step in range(6)]
    actions, share = acted(WormReflex(task, gain=4.0), errors, starts)
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
