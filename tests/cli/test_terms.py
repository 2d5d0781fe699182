"""The user's own terms: as the documentation shows them, and mistyped."""

import re
from pathlib import Path

import numpy as np
import pytest

from flyrl.cli.config import training_config
from flyrl.envs.config import env_record
from flyrl.envs.core import BatchedEnv
from flyrl.tasks import load_terms
from flyrl.training.config import training_record
from flyrl.training.run_folder import create_folder, note_resumption
from flyrl.training.runs import read_record
from tests.tasks.test_terms import fly_state, task_state

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "tasks.md").read_text()
ADDED = ["my_terms:HEIGHT", "my_terms:SLIP", "my_terms:COLLAPSE"]
WEIGHTS = {"progress": 0.1}


@pytest.fixture
def my_terms(tmp_path, own_module):
    """The current folder, with my_terms.py of the documentation in it."""
    (code,) = re.findall(r"^```python\n(# my_terms\.py\n.*?)^```", DOCS, re.M | re.S)
    own_module("my_terms", code)
    return tmp_path


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


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (["HEIGHT"], r"task\.terms\[0\] must be module:attribute, .*, got 'HEIGHT'"),
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
