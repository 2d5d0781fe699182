import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flyrl.policies import load_policy
from flyrl.training.runs import read_run
from tests.tiny import TINY_ARGUMENTS

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_train_from_an_empty_folder(tmp_path, run_here):
    result = run_here("train.py", "task=target", "terrain=flat", *TINY_ARGUMENTS)
    assert result.returncode == 0, result.stderr
    last = result.stdout.splitlines()[-1]
    assert last.startswith("run: runs/")
    # the run folder, and no output of Hydra's
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]
    folder = tmp_path / last.removeprefix("run: ")
    assert load_policy(folder / "last.safetensors").bundle.training["decisions"] == 64
    assert "train.py task=target" in (folder / "command.txt").read_text()
    assert (folder / "learning_curve.svg").is_file()
    assert (folder / "best.mp4").is_file() != ("Videos are left out: " in result.stderr)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["terain=flat"], "error: there is no key 'terain'; did you mean 'terrain'?"),
        (["resume="], "error: resume must be the path of a folder or file, got ''"),
        (["evaluation.folder="], "error: folder must be the path of a folder or file, got ''"),
        (["trust=yes"], "error: trust must be one of False, True, got 'yes'"),
        (["evaluate_after=[]"], "error: evaluate_after must be one of False, True, got []"),
        (["algo.gamma=2"], "error: algo.gamma must be a finite number from 0 to 1, got 2"),
        (["resume=runs/a", "seed=1"], "own settings; 'seed' cannot be given with it (allowed are"),
        (["resume=runs/a"], "error: runs/a is not the folder of a run: [Errno 2] No such file"),
    ],
)
def test_wrong_command_lines_end_in_one_line(tmp_path, run_here, arguments, message):
    result = run_here("train.py", *arguments)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert message in line
    assert list(tmp_path.iterdir()) == []


def test_help_names_the_choices(run_here):
    result = run_here("train.py", "--help")
    assert result.returncode == 0
    assert "terrain: air, any, ball, blocks, flat, gapped, hills" in result.stdout


@pytest.mark.slow
def test_sigterm_ends_a_run_in_order_and_says_how_to_go_on(tmp_path):
    longer = "training.total_timesteps=20000"
    command = [sys.executable, str(ROOT / "train.py"), *TINY_ARGUMENTS, longer]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, **pipes)
    deadline = time.monotonic() + 120
    while not any(file.stat().st_size for file in tmp_path.glob("runs/*/progress.csv")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    folder = tmp_path / output.splitlines()[-1].removeprefix("run: ")
    assert load_policy(folder / "last.safetensors").bundle.training["decisions"] >= 32
    assert (folder / "learning_curve.svg").is_file()
    assert read_run(folder).state == "interrupted"
    assert f"interrupted; resume with: resume={folder.relative_to(tmp_path)}" in errors


def test_a_folder_that_cannot_be_written_to_is_an_error_in_one_line(tmp_path, run_here):
    (tmp_path / "runs").write_text("a file")
    result = run_here("train.py", *TINY_ARGUMENTS)
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1] == "error: [Errno 17] File exists: 'runs'"
