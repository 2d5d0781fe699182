"""Smooth drives: a drive with a time constant, and costs of its change and of work."""

import numpy as np
import pytest

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.tasks import TASKS, task_from
from flyrl.tasks.terms import SMOOTHNESS
from tests.tasks.test_terms import fly_state, task_state

CHANGE, WORK = SMOOTHNESS
STEERING = ("target", "velocity", "path", "traverse", "heading", "slalom", "chase", "stop")


def test_a_change_of_drive_adds_up_over_both_sides():
    state = task_state(fly_state(command=[[1.0, 0.2]]), fly_state(command=[[0.5, 0.5]]))
    np.testing.assert_allclose(CHANGE.compute(state), [0.8])


def test_only_positive_work_counts():
    torques, velocities = np.zeros((1, 42)), np.zeros((1, 42))
    torques[0, :3], velocities[0, :3] = (2.0, -3.0, 5.0), (10.0, -4.0, -7.0)
    fly = fly_state(time=[0.52], actuator_torques=torques, joint_velocities=velocities)
    # (20 + 12) µN·mm/s for 0.02 s
    np.testing.assert_allclose(WORK.compute(task_state(fly, fly_state(time=[0.5]))), [0.64])


@pytest.mark.parametrize("name", STEERING)
def test_every_steering_task_is_smooth_and_can_weigh_it(name):
    task = TASKS[name]()
    assert task.drive_time_constant_s == 0.05
    assert [term.compute for term in task.reward[-2:]] == [term.compute for term in SMOOTHNESS]
    weighed = task_from({"name": name, "weights": {"drive_change": -0.05, "work": -0.001}})
    assert [term.weight for term in weighed.reward[-2:]] == [-0.05, -0.001]


def _drives(env, wanted, decisions):
    drives = []
    for _ in range(decisions):
        env.step(np.broadcast_to(env.task.actions.of(wanted), (env.num_envs, 2)))
        drives.append(env.state.actuation[0].copy())
    return np.array(drives)


@pytest.mark.parametrize(("interval_s", "decisions"), [(0.02, 5), (0.01, 10), (0.05, 2)])
def test_a_drive_follows_its_actions_whatever_the_decision_interval(interval_s, decisions):
    env = BatchedEnv(EnvConfig("target", decision_interval=interval_s), 1, 1)
    env.reset(seeds=[0])
    time_s = interval_s * np.arange(1, decisions + 1)[:, None]
    rise = (1.0, -0.4) * (1 - np.exp(-time_s / 0.05))  # from rest
    np.testing.assert_allclose(_drives(env, (1.0, -0.4), decisions), rise, atol=1e-12)
    fall = rise[-1] * np.exp(-time_s / 0.05)
    np.testing.assert_allclose(_drives(env, (0.0, 0.0), decisions), fall, atol=1e-12)
    env.reset(seeds=[1])
    np.testing.assert_array_equal(env.state.actuation, [[0.0, 0.0]])


def test_an_unfiltered_drive_is_what_is_asked_for_and_costs_nothing():
    env = BatchedEnv(EnvConfig("target_unfiltered"), 1, 1)
    env.reset(seeds=[0])
    np.testing.assert_array_equal(_drives(env, (1.0, -0.25), 1), [[1.0, -0.25]])
    smooth, unfiltered = TASKS["target"](), TASKS["target_unfiltered"]()
    assert [term.weight for term in unfiltered.reward[-2:]] == [0.0, 0.0]
    assert all(term.weight < 0.0 for term in smooth.reward[-2:])
    assert unfiltered.reward[:-2] == smooth.reward[:-2]


@pytest.mark.parametrize(
    ("name", "constant_s", "message"),
    [
        ("target", -0.1, "lie within 0.0"),
        *((name, 0.05, "be 0 in the task") for name in ("joints", "joints_box", "worm_crawl")),
    ],
)
def test_a_time_constant_is_not_negative_and_of_drives_alone(name, constant_s, message):
    assert task_from({"name": name, "drive_time_constant": 0}).drive_time_constant_s == 0.0
    with pytest.raises(ValueError, match=rf"task\.drive_time_constant must {message}"):
        task_from({"name": name, "drive_time_constant": constant_s})
