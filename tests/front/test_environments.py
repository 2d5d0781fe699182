"""Environments by the name of their task."""

import pytest

import flyrl
from flyrl.front.environments import _GOAL_TASKS, ENV_IDS
from flyrl.tasks import TASKS


def test_environments_by_task():
    assert flyrl.make("target", terrain="blocks").spec.id == "flyrl/Target-v0"
    assert flyrl.make_vec("target", num_envs=2).num_envs == 2
    assert flyrl.make_sb3("target", num_envs=2, terrain="blocks").num_envs == 2
    with pytest.raises(ValueError, match="did you mean 'target'"):
        flyrl.make("targt")


def test_every_task_has_an_id():  # the ids are written out, apart from the tasks
    assert sorted(ENV_IDS.values()) == sorted(TASKS)


def test_tasks_with_goals_are_registered_as_such():
    assert set(_GOAL_TASKS) == {name for name, task in TASKS.items() if task().has_goals}
