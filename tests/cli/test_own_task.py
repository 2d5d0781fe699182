"""A task of a user's own from the command line: trained, resumed, evaluated, reproduced."""

from pathlib import Path

import pytest
import yaml

from flyrl.policies import load_bundle, load_policy, save_bundle
from flyrl.policies.bundle import PolicyFileError
from flyrl.policies.sb3 import export_sb3
from flyrl.training.runs import read_record
from tests.tiny import TINY_ARGUMENTS
from tests.training.folders import make_run

ROOT = Path(__file__).parents[2]
TASK = ("task=my_lab:forage", "task.sources=2", "task.without=[tilt]", "task.weights.found=3")


@pytest.fixture
def my_lab(tmp_path, own_module):
    """The current folder, with the example's task in it."""
    own_module("my_lab", (ROOT / "examples" / "forage.py").read_text())
    return tmp_path


def test_loading_a_policy_imports_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stranger.py").write_text("import pathlib\npathlib.Path('ran').touch()\n")
    file = make_run(tmp_path / "run") / "last.safetensors"
    bundle = load_bundle(file)
    bundle.env["task"]["name"] = "stranger:task"
    save_bundle(bundle, file)
    policy = load_policy(tmp_path / "run")
    with pytest.raises(PolicyFileError, match=r"stranger:task, which is code that would be run"):
        export_sb3(policy.bundle)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("given", [{"name": "stranger:task"}, {"terms": ["stranger:TERM"]}])
@pytest.mark.parametrize("command", [("train.py", "resume=run"), ("flyrl", "reproduce", "run")])
def test_code_of_a_strangers_run_needs_consent(tmp_path, run_here, command, given):
    run = make_run(tmp_path / "run")
    settings = read_record(run)
    settings["task"] |= given
    (run / "config.yaml").write_text(yaml.safe_dump(settings))
    (tmp_path / "stranger.py").write_text("import pathlib\npathlib.Path('ran').touch()\n")
    result = run_here(*command)
    assert result.returncode == 2
    assert "names code that would be run: stranger:" in result.stderr
    assert not (tmp_path / "ran").exists()


@pytest.mark.slow
def test_a_task_of_ones_own_trains_is_evaluated_and_reproduced(my_lab, run_here):
    trained = run_here("train.py", *TASK, *TINY_ARGUMENTS, "video_after=false")
    assert trained.returncode == 0, trained.stderr
    run = Path(trained.stdout.splitlines()[-1].removeprefix("run: "))
    assert "my_lab_forage" in run.name
    task = read_record(my_lab / run)["task"]
    assert (task["name"], task["sources"]) == ("my_lab:forage", 2)
    assert (task["without"], task["weights"]["found"]) == (["observation.tilt"], 3.0)
    assert "sources_missed" in (my_lab / run / "evaluations.csv").read_text().splitlines()[0]
    again = run_here("flyrl", "reproduce", str(run), "--trust")
    assert "policy: identical, bit for bit" in again.stdout, again.stderr
    shown = ("episodes=2", "videos=false", "close_ups=false", "physics=fast", "folder=report")
    evaluated = run_here(
        "evaluate.py", *TASK, "task.time_limit=0.2", f"policies=[{run}]", "controllers=[pursuit]",
        *shown,
    )  # fmt: skip
    assert evaluated.returncode == 0, evaluated.stderr
    assert "warning" not in evaluated.stderr
    header = (my_lab / "report" / "episodes.csv").read_text().splitlines()[0]
    assert header.endswith(",sources_missed")
    refused = run_here("flyrl", "reproduce", "report/report.html")
    assert "names code that would be run: my_lab:forage" in refused.stderr
    repeated = run_here("flyrl", "reproduce", "report/report.html", "--trust")
    assert "episodes: identical, bit for bit" in repeated.stdout, repeated.stderr
    with (my_lab / "my_lab.py").open("a") as code:
        code.write("# as before, but for this\n")
    # the folder is refused after all else was checked, so that nothing walks
    changed = run_here("evaluate.py", *TASK, f"policies=[{run}]", "folder=/dev/null/x")
    assert "warning: ppo was trained with another version of my_lab\n" in changed.stderr
