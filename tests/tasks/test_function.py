"""The door for tasks: functions with checked parameters, by name, as settings and as records."""

import pickle
from dataclasses import replace
from typing import Annotated

import pytest

from flyrl.bodies.worm import CRAWLER
from flyrl.envs.config import EnvConfig
from flyrl.tasks import TASKS, Task, TaskFunction, task_from, task_record
from flyrl.validation import Within

TARGET = TASKS["target"]
NOTHING = 3


def plain(
    height: Annotated[float, Within(0, 5)] = 1.0, names=("a",), time_limit: float = 2
) -> Task:
    """A task as a user writes it: a function without more."""
    assert isinstance(height, float)
    return replace(TARGET(), success=f"{height:g} {names}", time_limit_s=time_limit)


def wrong() -> int:
    return 5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"distance": (-1, 30)}, r"task\.distance\[0\] must be .* from 0 to 1000, got -1"),
        ({"distance": (3, 30, 40)}, r"task\.distance must be a list of 2, got \(3, 30, 40\)"),
        ({"reach": "far"}, r"task\.reach must be a finite number .* got 'far'"),
        ({"time_limit": 0}, r"task\.time_limit must be .* got 0"),
    ],
)
def test_a_parameter_that_is_not_allowed_is_named(given, message):
    with pytest.raises(ValueError, match=message):
        TARGET(**given)


def test_the_task_carries_its_parameters_and_equal_ones_give_the_same_task():
    parameters = {"distance": (3.0, 30.0), "bearing": 180.0, "reach": 1.0, "time_limit": 3.0}
    assert TARGET(distance=[3, 30]).parameters == parameters
    assert TARGET(distance=[5, 15]) is TARGET()
    assert task_from("target") == TARGET()
    assert TARGET(reach=2) != TARGET()


@pytest.mark.parametrize("name", TASKS)
def test_the_record_of_a_task_gives_it_back(name):
    usual = TASKS[name]()
    task = TASKS[name](time_limit=7)
    assert task.time_limit_s == 7.0
    assert pickle.loads(pickle.dumps(TASKS[name])) is TASKS[name]
    assert pickle.loads(pickle.dumps(task)).parameters == task.parameters
    for each in (usual, task):
        assert task_from(task_record(each)) == each


def test_a_variant_has_the_parameters_of_its_base():
    assert TASKS["target_goal"].parameters == TARGET.parameters
    goal = TASKS["target_goal"](reach=0.5)
    assert goal.is_reached([[0.0, 0.0]], [[0.049, 0.0]]).tolist() == [True]  # in 10 mm
    assert goal.is_reached([[0.0, 0.0]], [[0.051, 0.0]]).tolist() == [False]


def test_a_function_of_ones_own_is_found_by_its_name():
    task = task_from({"name": f"{__name__}:plain", "height": 3, "names": ["b", ["c"]]})
    assert (task.name, task.success) == (f"{__name__}:plain", "3 ('b', ('c',))")
    record = task_record(task)
    assert record["names"] == ["b", ["c"]]
    assert task_from(record) == task
    assert task_from(plain).name == f"{__name__}:plain"
    with pytest.raises(ValueError, match=r"task\.height must be .* from 0 to 5, got 6"):
        task_from({"name": plain, "height": 6})


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (f"{__name__}:plan", "of the task functions in .*, must be .* did you mean 'plain'"),
        (f"{__name__}:NOTHING", ":NOTHING must be a task function, got a int"),
        (f"{__name__}:wrong", "must return a Task, got a int"),
        ("no_lab:plain", "no_lab cannot be imported"),
        ("tarket", "task must be one of .* did you mean 'target'"),
        (None, "task must be a Task, a task function or the name of one, got None"),
    ],
)
def test_what_is_no_task_is_named(name, message):
    with pytest.raises(ValueError, match=message):
        task_from({"name": name})


def test_what_cannot_be_a_task_function_is_refused():
    with pytest.raises(ValueError, match=r"not have a parameter 'weights', as .*broken"):

        @TaskFunction
        def broken(weights=1):
            """Nothing comes of it."""

    with pytest.raises(ValueError, match=r"worm of .* must be a WormConfig by default, got 3"):

        @TaskFunction
        def wormless(worm=3):
            """Nothing comes of it."""

    with pytest.raises(ValueError, match=r"<lambda> raised ZeroDivisionError: division by zero"):
        TaskFunction(lambda: 1 / 0)()


def test_records_from_before_tasks_had_parameters_are_read():
    weights = {"progress": 0.2, "success": 2.0, "time": -0.5, "lost_time": -0.5}
    old = {"name": "target", "terms": [], "weights": weights, "decision_interval": 0.02}
    assert task_from({**old, "time_limit": 3.0}) == TARGET()
    assert task_from({**old, "time_limit": None}) == TARGET()


def test_a_time_limit_needs_no_parameter():
    bare = TaskFunction(lambda: replace(TARGET(), success="bare"))
    assert task_from({"name": bare, "time_limit": 9}).time_limit_s == 9.0
    assert task_from({"name": bare, "time_limit": None}).time_limit_s == 3.0
    with pytest.raises(ValueError, match=r"task\.time_limit must be a finite number above 0"):
        task_from({"name": bare, "time_limit": -1})


def test_an_argument_that_cannot_be_hashed_is_one_all_the_same():
    @TaskFunction
    def taking(places=None):
        return replace(TARGET(), success=str(places))

    assert taking(places={"a": 1}).success == "{'a': 1}"


def test_a_parameter_called_worm_takes_the_worm():
    @TaskFunction
    def wriggle(worm=CRAWLER):
        return TASKS["worm_crawl"](worm=worm)

    assert wriggle.worm == CRAWLER
    assert EnvConfig(wriggle).scene.body == CRAWLER
    longer = replace(CRAWLER, segments=7)
    assert EnvConfig(wriggle, body=longer).resolved_task.actions.size == 12
    assert wriggle.parameters == ()


def test_an_environment_takes_a_task_in_every_form():
    given = ["target", {"name": "target"}, TARGET, TARGET(), {"name": TARGET}]
    assert {EnvConfig(each).resolved_task for each in given} == {TARGET()}
    assert TASKS["target"](reach=2) == EnvConfig({"name": "target", "reach": 2}).resolved_task


def test_a_mapping_brings_the_decision_interval_of_its_record():
    config = EnvConfig({"name": "target", "decision_interval": 0.01})
    assert config.decision_interval_s == 0.01
    assert EnvConfig(config.task, decision_interval=0.04).decision_interval_s == 0.04
