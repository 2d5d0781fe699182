"""The user's own terms: as the documentation shows them, and mistyped."""

import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from flyrl.cli.config import evaluation_config, evaluation_settings, training_config
from flyrl.envs.core import BatchedEnv
from flyrl.envs.record import env_record
from flyrl.tasks import TASKS, load_terms
from flyrl.training.config import training_record
from flyrl.training.run_folder import create_folder, note_resumption
from flyrl.training.runs import read_record
from tests.tasks.test_terms import fly_state, task_state
from tests.tiny import TINY_ARGUMENTS
from tests.training.folders import make_run

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "tasks.md").read_text()
ADDED = ["my_terms:HEIGHT", "my_terms:SLIP", "my_terms:COLLAPSE"]
WEIGHTS = {"progress": 0.1}


@pytest.fixture
def my_terms(tmp_path, monkeypatch):
    """The current folder, with my_terms.py of the documentation in it."""
    (code,) = re.findall(r"^```python\n(# my_terms\.py\n.*?)^```", DOCS, re.M | re.S)
    (tmp_path / "my_terms.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "my_terms", raising=False)
    yield tmp_path
    sys.modules.pop("my_terms", None)


def groups(**task):
    return {
        "task": {"name": "target", **task},
        **{group: {"name": name} for group, name in (("body", "current"), ("terrain", "flat"))},
        **{"controller": {"name": "hybrid"}, "physics": {"timestep": 1e-3}},
        **{"algo": {"name": "ppo"}, "training": {}, "seed": 0},
    }


@pytest.mark.usefixtures("my_terms")
def test_the_example_of_the_docs_walks():
    config = training_config(groups(terms=ADDED, weights=WEIGHTS))
    env = BatchedEnv(config.env, 2)
    env.reset(seeds=[0, 1])
    walk = env.task.actions.of(np.ones((2, 2)))
    for _ in range(20):
        transition = env.step(walk)
    assert transition.outcome.tolist() == ["running", "running"]
    (height,) = env.task.slices()["height"].indices(99)[:1]
    np.testing.assert_allclose(
        transition.observation[:, height], env.state.position_w[:, 2], rtol=1e-6
    )
    assert (env.task_state().totals["slip"] > 0).all()
    (collapse,) = (end for end in env.task.terminations if end.outcome == "collapse")
    state = task_state(fly_state(2, position_w=[[0, 0, 0.4], [0, 0, 1.2]]))
    assert collapse.holds(state).tolist() == [True, False]


@pytest.mark.usefixtures("my_terms")
def test_the_record_of_a_run_gives_its_task_back(tmp_path):
    config = training_config(groups(terms=ADDED, weights=WEIGHTS))
    assert env_record(config.env)["task"]["terms"] == ADDED
    assert env_record(config.env)["task"]["weights"]["progress"] == 0.1
    folder = create_folder(config, tmp_path / "runs")
    again = training_config(read_record(folder))
    assert training_record(again) == training_record(config)
    assert again.env.resolved_task == config.env.resolved_task


def test_a_run_that_goes_on_with_other_terms_says_so(my_terms, tmp_path, capsys):
    config = training_config(groups(terms=ADDED))
    folder = create_folder(config, tmp_path / "runs")
    with (my_terms / "my_terms.py").open("a") as code:
        code.write("# as before, but for this\n")
    note_resumption(config, folder)
    assert "\n  terms.my_terms: " in capsys.readouterr().err


@pytest.mark.usefixtures("my_terms")
def test_an_evaluation_takes_the_same_terms():
    config = evaluation_config(groups(terms=ADDED, weights=WEIGHTS), evaluation_settings({}), "")
    assert tuple(config.resolved_task.added) == tuple(ADDED)
    # a resumed run hands on its own decision interval, which is the task's
    resumed = groups(terms=ADDED, decision_interval=0.02)
    assert evaluation_config(resumed, evaluation_settings({}), "").resolved_task.name


def test_without_terms_a_task_is_the_one_of_the_table():
    config = training_config(groups())
    assert config.env.resolved_task == TASKS["target"]()
    assert replace(config.env, task="target").resolved_task == config.env.resolved_task


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (["HEIGHT"], r"task\.terms\[0\] must be module:attribute, .*, got 'HEIGHT'"),
        (["my_terms:"], r"must be module:attribute"),
        (["os.path.join('a'):x"], r"must be module:attribute"),
        (["my_term:HEIGHT"], r"my_term cannot be imported: ModuleNotFoundError: No module named"),
        (["my_terms:HIGHT"], r"task\.terms\[0\], of the terms in .*, got 'HIGHT'; did you mean"),
        (["my_terms:np"], r"my_terms:np must be a term, got a module"),
        ([ADDED[0], ADDED[0]], r"task\.terms\[1\] is 'my_terms:HEIGHT', which is there already"),
        (["broken:X"], r"broken cannot be imported: ZeroDivisionError"),
    ],
)
def test_terms_that_cannot_be_had(my_terms, terms, message):
    (my_terms / "broken.py").write_text("1 / 0\n")
    with pytest.raises(ValueError, match=message):
        load_terms(terms)


@pytest.mark.parametrize("command", [("train.py", "resume=run"), ("flyrl", "reproduce", "run")])
def test_the_modules_of_a_strangers_run_need_consent(tmp_path, run_here, command):
    folder = make_run(tmp_path / "run")
    settings = read_record(folder)
    settings["task"]["terms"] = ["stranger:TERM"]
    (folder / "config.yaml").write_text(yaml.safe_dump(settings))
    (tmp_path / "stranger.py").write_text("import pathlib\npathlib.Path('ran').touch()\n")
    result = run_here(*command)
    assert result.returncode == 2
    assert "names code that would be run: stranger:TERM. Add" in result.stderr
    assert not (tmp_path / "ran").exists()


def test_weights_that_cannot_be_given():
    with pytest.raises(
        ValueError, match=r"task\.weights\.progress must be a finite number, got 'high'"
    ):
        training_config(groups(weights={"progress": "high"}))
    with pytest.raises(ValueError, match=r"task\.weights .*'slip'"):
        training_config(groups(weights={"slip": 0.1}))
    with pytest.raises(ValueError, match=r"task\.weights must be a Mapping, got 3"):
        training_config(groups(weights=3))


def _commands(run):
    """The command lines in the section on own terms, as Python's arguments."""
    section = DOCS.split("## Terms of your own")[1].replace("<run folder>", run)
    lines = re.findall(r"^python (.*?[^\\])$", section, re.M | re.S)
    return [shlex.split(line.replace("\\\n", " ")) for line in lines]


@pytest.mark.slow
def test_the_commands_of_the_docs_train_and_evaluate(my_terms, run_here):
    train, *_ = _commands("")
    trained = run_here(*train, *TINY_ARGUMENTS, "video_after=false")
    assert trained.returncode == 0, trained.stderr
    _, evaluate, *_ = _commands(trained.stdout.splitlines()[-1].removeprefix("run: "))
    short = ("controllers=[zero]", "episodes=1", "task.time_limit=0.2")
    short = (*short, "videos=false", "close_ups=false")
    evaluated = run_here(*evaluate, *short)
    assert evaluated.returncode == 0, evaluated.stderr
    assert "report: " in evaluated.stdout
    assert "warning" not in evaluated.stderr
    with (my_terms / "my_terms.py").open("a") as code:
        code.write("# as before, but for this\n")
    evaluated = run_here(*evaluate, *short)
    assert "warning: ppo was trained with another version of my_terms\n" in evaluated.stderr
