"""The ids are written out, apart from the tasks: they must name each of them."""

from flyrl.envs.registration import _GOAL_TASKS, ENV_IDS
from flyrl.tasks import TASKS


def test_every_task_has_an_id():
    assert sorted(ENV_IDS.values()) == sorted(TASKS)


def test_tasks_with_goals_are_registered_as_such():
    assert set(_GOAL_TASKS) == {name for name, task in TASKS.items() if task().has_goals}
