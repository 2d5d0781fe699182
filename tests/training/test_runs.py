import subprocess
import sys

import pytest

from flyrl.training.runs import (
    RunIsHeldError,
    find_runs,
    flat,
    held,
    is_running,
    nested,
    read_rows,
    read_run,
    training_returns,
)
from tests.training.folders import make_run

HOLD = """
import sys, time
from pathlib import Path
from flyrl.training.runs import held
with held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(120)
"""


def test_a_run_that_ended(tmp_path):
    rows = [(50, 0.5, 0.5), (100, 0.5, 1.0), (200, 0.25, 2.0)]
    run = read_run(make_run(tmp_path / "a", evaluations=rows))
    assert run.state == "finished"
    assert run.setting("algo.name") == "ppo"
    assert run.decisions == 200
    assert run.wall_time_s == 12.5
    # of equal success, the higher return
    assert run.best == {
        "decisions": 100, "success_rate": 0.5, "mean_return": 1.0, "mean_duration_s": 1.0,
    }  # fmt: skip
    assert run.last["decisions"] == 200
    assert run.problems == ()
    assert read_run(make_run(tmp_path / "b", interrupted_by="SIGTERM")).state == "interrupted"


def test_a_run_without_a_status_was_killed_and_its_tables_say_how_far_it_came(tmp_path):
    folder = make_run(tmp_path / "a", evaluations=[(100, 0.5, 1.0)])
    (folder / "status.json").unlink()
    (folder / "progress.csv").write_text("time/total_timesteps,time/time_elapsed\n120,7\n240,9\n36")
    run = read_run(folder)
    assert (run.state, run.decisions, run.wall_time_s) == ("interrupted", 240, 9.0)


def test_a_run_that_a_process_holds_is_running_until_that_is_killed(tmp_path):
    folder = make_run(tmp_path / "a", interrupted_by="SIGTERM")
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        state = read_run(folder).state
        with pytest.raises(RunIsHeldError, match="another process trains in"), held(folder):
            pass
        process.kill()
    assert state == "running"
    assert not is_running(folder)
    assert read_run(folder).state == "interrupted"
    with held(folder):
        assert is_running(folder)


@pytest.mark.parametrize(
    ("file", "contents", "problem"),
    [
        *[("config.yaml", text, "config.yaml cannot be read: ") for text in ("a: [", "\x00")],
        *[
            ("config.yaml", text, "config.yaml cannot be read: no task.name")
            for text in ("task: [1]", "task: 1", "", "a word", "- a")
        ],
        ("config.yaml", "a: &a [1]\nb: [*a]", "config.yaml cannot be read: "),
        ("config.yaml", "!!python/object/apply:os.getcwd []", "config.yaml cannot be read"),
        *[("status.json", text, "status.json cannot be read") for text in ("{", "[]", "[" * 10**5)],
        ("status.json", "{}", "status.json cannot be read: 'decisions'"),
        ("provenance.json", "[]", "provenance.json cannot be read: no JSON object"),
        ("evaluations.csv", "decisions\n1\n", "evaluations.csv cannot be read: 'success_rate'"),
        ("evaluations.csv", "decisions\nx\n", "evaluations.csv cannot be read: could not convert"),
        ("evaluations.csv", b"\xff\xfe", "evaluations.csv cannot be read"),
        ("progress.csv", b"\xff\xfe", "progress.csv cannot be read: "),
    ],
)
def test_a_damaged_file_is_a_problem_not_an_error(tmp_path, file, contents, problem):
    folder = make_run(tmp_path / "a")
    data = contents if isinstance(contents, bytes) else contents.encode()
    (folder / file).write_bytes(data)
    (found,) = read_run(folder).problems
    assert found.startswith(problem)


def test_what_is_missing(tmp_path):
    folder = make_run(tmp_path / "a")
    (folder / "last.safetensors").unlink()
    assert read_run(folder).problems == ("last.safetensors is missing",)
    for name in ("config.yaml", "provenance.json"):
        (folder / name).unlink()
    run = read_run(folder)
    assert run.state == "damaged"
    assert run.problems == ("config.yaml is missing", "provenance.json is missing")


def test_runs_are_found_in_sweeps_too_and_nothing_else_is(tmp_path):
    inside = [make_run(tmp_path / name) for name in ("b", "sweeps/x/a")]
    (tmp_path / "notes").mkdir()
    make_run(tmp_path / ".trash" / "c")
    make_run(tmp_path / "b" / "evaluation" / "d")
    assert find_runs(tmp_path) == inside
    assert find_runs(inside[0]) == inside[:1]


def test_a_row_that_was_cut_off_is_not_read(tmp_path):
    (tmp_path / "rows.csv").write_text("a,b\n1,2\n3")
    assert read_rows(tmp_path / "rows.csv") == [{"a": "1", "b": "2"}]
    assert read_rows(tmp_path / "none.csv") == []


def test_training_returns_leave_out_updates_without_a_whole_episode(tmp_path):
    (tmp_path / "progress.csv").write_text(
        "time/total_timesteps,rollout/ep_rew_mean\n64,\n128,1.5\n,2.0\n"
    )
    assert training_returns(tmp_path) == [(128.0, 1.5)]


def test_dotted_keys():
    tree = {"a": {"b": 1, "c": [2]}, "d": 3}
    assert flat(tree) == {"a.b": 1, "a.c": [2], "d": 3}
    assert nested(tree, "a.b") == 1
    assert nested(tree, "a.b.c") is None
