"""The user's own terms of the documentation: on record, and mistyped."""

import re
from pathlib import Path

import pytest

from flyrl.cli.config import training_config
from flyrl.envs.config import env_record
from flyrl.tasks import load_terms
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.run_folder import create_folder, note_resumption
from flyrl.training.runs import read_record

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "tasks.md").read_text()
ADDED = ["my_terms:HEIGHT", "my_terms:SLIP", "my_terms:COLLAPSE"]


@pytest.fixture
def my_terms(tmp_path, own_module):
    """The current folder, with my_terms.py of the documentation in it."""
    (code,) = re.findall(r"^```python\n(# my_terms\.py\n.*?)^```", DOCS, re.M | re.S)
    own_module("my_terms", code)
    return tmp_path


def test_a_run_has_its_terms_on_record_and_says_so_if_it_resumes_with_others(
    my_terms, tmp_path, capsys
):
    task = {"name": "target", "terms": ADDED, "weights": {"progress": 0.1}}
    config = training_config({**training_record(TrainingConfig()), "task": task})
    assert env_record(config.env)["task"]["terms"] == ADDED
    assert env_record(config.env)["task"]["weights"]["progress"] == 0.1
    folder = create_folder(config, tmp_path / "runs")
    again = training_config(read_record(folder))
    assert training_record(again) == training_record(config)
    assert again.env.resolved_task == config.env.resolved_task
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
