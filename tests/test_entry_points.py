from pathlib import Path

import pytest

from flyrl.entry_points import check_trust, is_entry_point, load_module, named_code, takes


def test_module_and_attribute():
    assert all(map(is_entry_point, ("mine:make", "my.own_module:MAKE")))
    others = ("mine", "mine:", ":make", "a b:c", "x/y", "ppo:a.zip", "1:a")
    assert not any(map(is_entry_point, others))


def test_a_module_in_the_current_folder_is_found(own_module):
    own_module("found_here", "ANSWER = 42\n")
    assert load_module("found_here:ANSWER", "key", "a:b")["ANSWER"] == 42


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("not_here:ANSWER", "cannot be imported: ModuleNotFoundError"),
        ("broken:ANSWER", "cannot be imported: KeyError"),
        ("x", r"key must be module:attribute, e\.g\. a:b, got 'x'"),
    ],
)
def test_a_module_that_cannot_be_imported(own_module, name, message):
    own_module("broken", "raise KeyError('no')")
    with pytest.raises(ValueError, match=message):
        load_module(name, "key", "a:b")


def test_what_names_code_at_any_depth():
    settings = {
        "task": {"name": "target", "terms": ["mine:TERM"], "weights": {"my.terms:X": 1.0}},
        "evaluation": {"policies": ["runs/a", "target-flat", "mine:make", "ppo:a.zip"]},
        "seed": 3,
    }
    assert named_code(settings) == ["mine:TERM", "my.terms:X", "mine:make", "ppo:a.zip"]
    on_legs = {"policies": ["pursuit@mine:Wave", "mine:dodge@cpg"]}
    assert named_code(on_legs) == ["mine:Wave", "mine:dodge"]
    assert named_code({"task": {"name": "target"}, "policies": ["target-flat"]}) == []


def test_code_needs_consent():
    settings = {"task": {"terms": ["mine:TERM"]}}
    with pytest.raises(ValueError, match=r"runs/a names code .*: mine:TERM\. Add --trust if"):
        check_trust(Path("runs/a"), settings, False, "--trust")
    check_trust(Path("runs/a"), settings, True, "--trust")
    check_trust(Path("runs/a"), {"task": {"terms": []}}, False, "--trust")


def test_functions_are_told_apart_by_their_arguments():
    def by_time(time_s, observation):
        return 1.0, 1.0

    assert takes(by_time, 2)
    assert not takes(by_time, 1)
    assert takes(lambda task, speed=1.0: 0, 1)
