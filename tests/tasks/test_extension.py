import dataclasses
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from flyrl.tasks import (
    FAILURES,
    OUTCOMES,
    TASKS,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Termination,
    extended,
    task_record,
    term_digests,
)

TARGET = TASKS["target"]


def _ones(state):
    return np.ones(len(state.fly.time))


HEIGHT = ObservationTerm("height", (1,), 0.0, 5.0, _ones, "mm")
SLIP = RewardTerm("slip", -0.1, _ones, "mm")
SWAY = MeanTerm("sway", 1, 0.1, _ones, "mm")
COLLAPSE = Termination("collapse", _ones)


def test_each_term_goes_to_the_end_of_its_own_table():
    terms = {"a:HEIGHT": HEIGHT, "a:SLIP": SLIP, "a:SWAY": SWAY, "a:COLLAPSE": COLLAPSE}
    task = extended(TARGET, terms, {})
    assert task.observation == (*TARGET.observation, HEIGHT)
    assert task.reward == (*TARGET.reward, SLIP)
    assert task.means == (SWAY,)
    assert task.terminations == (*TARGET.terminations, COLLAPSE)
    assert task.slices()["height"] == slice(46, 47)


def test_rewards_are_weighed_anew_by_name():
    task = extended(TARGET, {"a:SLIP": SLIP}, {"progress": 0.1, "slip": -0.5})
    weights = {term.name: term.weight for term in task.reward}
    expected = {"progress": 0.1, "success": 2.0, "time": -0.5, "lost_time": -0.5, "slip": -0.5}
    assert weights == expected


def test_the_record_says_what_to_extend_the_task_with():
    task = extended(TARGET, {"a:HEIGHT": HEIGHT, "b:SLIP": SLIP}, {"progress": 0.1}, 1.5)
    record = task_record(task)
    assert record["terms"] == ["a:HEIGHT", "b:SLIP"]
    terms = dict(zip(record["terms"], (HEIGHT, SLIP), strict=True))
    own = TASKS[record["name"]]
    assert extended(own, terms, record["weights"], record["time_limit"]) == task


@pytest.mark.parametrize(("time_limit_s", "message"), [(3.02, "at most .* 3.0 s"), (0, "above 0")])
def test_a_time_limit_beyond_the_tasks_own_is_refused(time_limit_s, message):
    with pytest.raises(ValueError, match=r"task\.time_limit must be .*" + message):
        extended(TARGET, {}, {}, time_limit_s)


def test_the_module_of_terms_has_a_digest(tmp_path, monkeypatch):
    module = types.ModuleType("some_terms")
    module.__file__ = str(tmp_path / "some_terms.py")
    Path(module.__file__).write_text("abc")
    monkeypatch.setitem(sys.modules, "some_terms", module)
    # of "abc", as FIPS 180 has it
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    names = ["some_terms:A", "some_terms:B", "nowhere:C"]
    assert term_digests(names) == {"some_terms": digest, "nowhere": None}


def test_a_task_without_a_time_limit_takes_any():
    assert extended(TASKS["hybrid_turning"], {}, {}, 100).time_limit_s == 100


@pytest.mark.parametrize(
    ("terms", "weights", "message"),
    [
        ({"a:x": 3.0}, {}, r"'a:x' must be one of ObservationTerm, .*, got 3\.0"),
        ({"a:X": dataclasses.replace(HEIGHT, name="tilt")}, {}, "observation .* 'tilt' 2 times"),
        ({"a:X": SLIP, "b:X": SLIP}, {}, "reward must differ, got 'slip' 2 times"),
        ({"a:X": Termination("fall", _ones)}, {}, "terminations must differ, got 'fall' 2 times"),
        ({}, {"progres": 1.0}, r"task\.weights .*'progres'; did you mean 'progress'\?"),
        ({}, {"progress": float("nan")}, r"task\.weights\.progress must be a finite number"),
    ],
)
def test_what_does_not_fit_is_refused(terms, weights, message):
    with pytest.raises(ValueError, match=message):
        extended(TARGET, terms, weights)


@pytest.mark.parametrize("name", TASKS)
def test_every_task_ends_when_the_fly_fails(name):
    assert set(FAILURES) <= set(TASKS[name].terminations)


@pytest.mark.parametrize("shape", [6, (0,), (1.5,), [1]])
def test_an_observation_has_a_shape(shape):
    with pytest.raises(ValueError, match="shape of 'height' must be a tuple of whole numbers"):
        dataclasses.replace(HEIGHT, shape=shape)


@pytest.mark.parametrize("bounds", [{"low": 5.0}, {"high": np.inf}, {"low": np.nan}])
def test_an_observation_has_finite_bounds(bounds):
    with pytest.raises(ValueError, match="of 'height' must be"):
        dataclasses.replace(HEIGHT, **bounds)


@pytest.mark.parametrize("outcome", ["", "running", "timeout", "unstable"])
def test_outcomes_of_the_environment_are_no_terminations(outcome):
    with pytest.raises(ValueError, match=r"outcome must be a name other than running.*got"):
        Termination(outcome, _ones)


def test_only_the_outcome_success_is_one():
    assert Termination("success", _ones).is_success
    assert not COLLAPSE.is_success


def test_codes_of_outcomes_stay_when_a_termination_is_added():
    assert TARGET.outcomes == OUTCOMES
    assert OUTCOMES == ("running", "success", "timeout", "fall", "left_arena", "unstable")
    assert extended(TARGET, {"a:X": COLLAPSE}, {}).outcomes == (*OUTCOMES, "collapse")


def test_a_mean_forgets_within_some_time():
    with pytest.raises(ValueError, match="time_constant_s of 'sway' must be a finite number above"):
        dataclasses.replace(SWAY, time_constant_s=0.0)
