import dataclasses
import hashlib
from pathlib import Path

import numpy as np
import pytest

from flyrl.tasks import (
    FAILURES,
    OUTCOMES,
    TASKS,
    ErrorTerm,
    MeanTerm,
    ObservationTerm,
    RewardTerm,
    Termination,
    code_digests,
    extended,
    task_from,
    task_record,
)

TARGET = TASKS["target"]()


def _ones(state):
    return np.ones(len(state.fly.time))


HEIGHT = ObservationTerm("height", (1,), 0.0, 5.0, _ones, "mm")
TILT = dataclasses.replace(HEIGHT, name="tilt")
SLIP = RewardTerm("slip", -0.1, _ones, "mm")
SWAY = MeanTerm("sway", 1, 0.1, _ones, "mm")
COLLAPSE = Termination("collapse", _ones)
SLIDE = ErrorTerm("slide_mm", 5.0, _ones, "mm that legs slip", smallest_effect=0.5)


def test_each_term_goes_to_the_end_of_its_own_table():
    terms = {"a:HEIGHT": HEIGHT, "a:SLIP": SLIP, "a:SWAY": SWAY}
    terms |= {"a:COLLAPSE": COLLAPSE, "a:SLIDE": SLIDE}
    task = extended(TARGET, terms, {"slip": -0.5})
    assert task.observation == (*TARGET.observation, HEIGHT)
    assert task.reward == (*TARGET.reward, dataclasses.replace(SLIP, weight=-0.5))
    assert task.means == (SWAY,)
    assert task.terminations == (*TARGET.terminations, COLLAPSE)
    assert task.errors == (*TARGET.errors, SLIDE)
    assert task.slices()["height"] == slice(47, 48)


def test_the_record_says_what_to_make_the_task_of():
    terms = {f"{__name__}:HEIGHT": HEIGHT, f"{__name__}:TILT": TILT}
    settings = {"distance": (3, 30), "time_limit": 6, "drive_time_constant": 0.1}
    own = task_from({"name": "target", **settings})
    task = extended(own, terms, {"progress": 0.1}, ["tilt", "reward.success"])
    assert task_record(task) == {
        "name": "target",
        "distance": [3.0, 30.0],
        "bearing": 180.0,
        "reach": 1.0,
        "time_limit": 6.0,
        "drive_time_constant": 0.1,
        "terms": [f"{__name__}:HEIGHT", f"{__name__}:TILT"],
        "without": ["observation.tilt", "reward.success"],
        "weights": {
            "progress": 0.1,
            "time": -0.5,
            "lost_time": -0.5,
            "drive_change": -0.03,
            "work": -0.0012,
        },
    }
    assert task_from(task_record(task)) == task


def test_a_term_that_is_taken_out_is_gone():
    weights = {
        term.name: term.weight for term in TARGET.reward
    }  # those of the others do not matter
    task = extended(TARGET, {}, weights, ["tilt", "time", "left_arena", "heading_error_deg"])
    assert [term.name for term in task.observation] == [
        term.name for term in TARGET.observation if term.name != "tilt"
    ]
    left = ["progress", "success", "lost_time", "drive_change", "work"]
    assert [term.name for term in task.reward] == left
    assert [end.outcome for end in task.terminations] == ["success", "fall"]
    assert task.errors == ()


def test_a_term_goes_to_the_place_of_the_one_of_its_name_that_is_taken_out():
    task = extended(TARGET, {"a:TILT": TILT, "a:HEIGHT": HEIGHT}, {}, ["tilt"])
    place = [term.name for term in TARGET.observation].index("tilt")
    assert task.observation[place] == TILT
    assert task.observation[-1] == HEIGHT
    assert len(task.observation) == len(TARGET.observation) + 1


def test_an_added_term_can_be_taken_out_again():
    added = extended(TARGET, {"a:HEIGHT": HEIGHT}, {})
    again = extended(added, {}, {}, ["height"])
    assert again == TARGET


def test_the_module_of_terms_has_a_digest():
    digest = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    names = [f"{__name__}:A", f"{__name__}:B", "nowhere:C"]
    assert code_digests(names) == {__name__: digest, "nowhere": None}


@pytest.mark.parametrize(
    ("terms", "weights", "without", "message"),
    [
        ({}, {}, ["tlit"], r"task\.without must be one of .*'tlit'; did you mean 'tilt'"),
        ({}, {}, ["success"], "say which 'success', reward.success or terminations.success"),
        (
            {},
            {},
            [term.name for term in TARGET.observation],
            "must leave a term of the observation",
        ),
        ({"a:x": 3.0}, {}, [], r"'a:x' must be one of ObservationTerm, .*, got 3\.0"),
        ({"a:X": TILT}, {}, [], "must not hold .observation.tilt. twice"),
        ({"a:X": SLIP, "b:X": SLIP}, {}, [], "must not hold .reward.slip. twice"),
        ({"a:X": Termination("fall", _ones)}, {}, [], "must not hold .terminations.fall. twice"),
        ({}, {"progres": 1.0}, [], r"task\.weights .*'progres'; did you mean 'progress'\?"),
        ({}, {"progress": float("nan")}, [], r"task\.weights\.progress must be a finite number"),
    ],
)
def test_what_does_not_fit_is_refused(terms, weights, without, message):
    with pytest.raises(ValueError, match=message):
        extended(TARGET, terms, weights, without)


@pytest.mark.parametrize("name", [name for name, task in TASKS.items() if not task.worm])
def test_every_task_ends_when_the_fly_fails(name):
    assert set(FAILURES) <= set(TASKS[name]().terminations)


def test_codes_of_outcomes_stay_when_a_termination_is_added():
    assert TARGET.outcomes == OUTCOMES
    assert OUTCOMES == ("running", "success", "timeout", "fall", "left_arena", "unstable")
    assert extended(TARGET, {"a:X": COLLAPSE}, {}).outcomes == (*OUTCOMES, "collapse")


@pytest.mark.parametrize(
    ("term", "changes", "message"),
    [
        *((HEIGHT, {"shape": shape}, "height.shape") for shape in (6, (1.5,))),
        (HEIGHT, {"low": 5.0}, "height.high must be above its low"),
        (HEIGHT, {"high": np.inf}, "height.high must be a finite number"),
        (HEIGHT, {"spread": -1.0}, "height.spread must be a finite number from 0"),
        (HEIGHT, {"spread": (1.0, 2.0)}, "height.spread must be one number or 1"),
        (SWAY, {"time_constant_s": 0.0}, "sway.time_constant_s must be a finite number from"),
        *(
            (COLLAPSE, {"outcome": name}, "outcome must be a name other than running.*got")
            for name in ("", "running", "timeout", "unstable")
        ),
    ],
)
def test_a_term_that_cannot_be_one_is_refused(term, changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(term, **changes)
