"""Every command in the documentation is one that its program takes.

Trainings and evaluations run, with few decisions and episodes; of a sweep its first run, of what is
varied one value each, of terrains one. So does what is said to fail. Figures, lists of runs, pages
and tools have tests of their own; here their commands are handed to the checks that programs make
before they begin to work. What is not even that, `NOT_CHECKED` gives the reason for.
"""

import itertools
import re
import sys

import pytest

from flyrl.cli import evaluate, train
from tests.docs.commands import (
    NOT_CHECKED,
    check,
    commands,
    composed,
    evaluated,
    lines,
    trained,
    words,
)
from tests.docs.pages import PAGES, blocks, language_of

PROGRAMS = {"train": train.main, "evaluate": evaluate.main}


def _failing():
    """Commands that are followed by the error that they end with."""
    for page in PAGES:
        examples = blocks(page, "bash", "text")
        for block, after in itertools.pairwise(examples):
            is_pair = (language_of(block), language_of(after)) == ("bash", "text")
            if is_pair and after.parsed.startswith("error: "):
                (command,) = lines(block.parsed)
                yield command, after.parsed.strip()


def _terms(overrides):
    """The task and the terms of its own that a training or an evaluation asks for."""
    keys = ("task.terms=", "task.without=", "task=my_")
    return tuple(each for each in overrides if each.startswith(keys))


FAILING = dict(_failing())


@pytest.mark.slow
def test_every_training_runs_and_every_evaluation_too(folder_of, subtests):
    folder_of("docs/controllers.md")
    folder = folder_of("docs/tasks.md")
    before, learned = {}, {}
    for overrides, (page, command) in composed("train").items():
        if command not in FAILING:
            with subtests.test(f"{page}: {command}"):
                run = trained(command, overrides, folder / "runs", before)
                if run is not None:
                    assert (run.folder / "last.safetensors").exists()
                    learned[_terms(overrides)] = run.folder
    for overrides, (page, command) in composed("evaluate").items():
        if command not in FAILING:
            with subtests.test(f"{page}: {command}"):
                assert not evaluated(overrides, learned[_terms(overrides)]).protocol["crashes"]


@pytest.mark.parametrize("page", PAGES)
def test_other_commands_are_accepted(page):
    for command, is_whole in commands(page):
        check(command, is_whole=is_whole)


@pytest.mark.parametrize("command", FAILING)
def test_a_command_that_is_said_to_fail_says_so(command, folder_of, monkeypatch, capsys):
    (folder_of("docs/troubleshooting.md") / "model.zip").touch()
    program, *arguments = words(command)
    monkeypatch.setattr(sys, "argv", [f"{program}.py", *arguments])
    with pytest.raises(SystemExit) as end:
        PROGRAMS[program]()
    assert end.value.code == 2
    expected = ".*".join(re.escape(part) for part in FAILING[command].split("…"))
    assert re.search(expected, capsys.readouterr().err, re.DOTALL)


def test_what_is_not_checked_is_there():
    programs = {words(command)[0] for page in PAGES for command, _ in commands(page)}
    assert set(NOT_CHECKED) <= programs


@pytest.mark.parametrize(
    "command", ["flyrl run", "make tset", "pip install -e '.[slum]'", "cat runs"]
)
def test_a_wrong_command_is_found(command):
    with pytest.raises(AssertionError):
        check(command)
