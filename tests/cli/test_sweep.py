import contextlib
import csv
import os
import signal
import subprocess
import sys
import threading
import time
import types
from pathlib import Path

import psutil
import pytest

from flyrl.cli.entry import job_names, note_of, run_job
from flyrl.training.callback import RunCallback
from flyrl.training.runs import read_run
from tests.tiny import TINY_ARGUMENTS
from tests.training.folders import make_run

ROOT = Path(__file__).parents[2]
TINY = (*TINY_ARGUMENTS, "training.evaluation_episodes=1", "video_after=false")


def _tiny(*arguments):
    """The arguments, with what makes a training tiny where they ask for nothing else."""
    asked = {argument.partition("=")[0] for argument in arguments}
    return [*arguments, *(one for one in TINY if one.partition("=")[0] not in asked)]


def _started(folder, *arguments):
    """A training in a process of its own, for other launchers."""
    return subprocess.Popen(
        [sys.executable, str(ROOT / "train.py"), *_tiny(*arguments)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.fixture
def train_here(run_here):
    """Train in this process."""
    return lambda *arguments: run_here("train.py", *_tiny(*arguments))


def test_jobs_and_folders_are_named_by_swept_values_that_any_file_system_takes():
    long = f"+task.terms=['{'x' * 300}:Y']"
    jobs = [
        ("seed=0", "algo=ppo", "algo.gamma=0.99", "algo.hidden_layers=[64,64]", "x=1"),
        ("seed=1", "algo=sac", "algo.gamma=0.9", r"evaluation.policies=[a/b\:é]", "x=1"),
        ("seed=2", "algo=sac", "algo.gamma=0.9", long, "x=1"),
    ]
    titles, labels = zip(*job_names(jobs).values(), strict=True)
    swept = "seed=1 algo=sac algo.gamma=0.9 evaluation.policies=[a/b:é]"
    assert titles[1] == f"job 2 of 3: {swept}"
    assert labels == (
        "gamma-0.99_hidden_layers-64-64",
        "gamma-0.9_policies-a-b",
        ("gamma-0.9_terms--" + "x" * 80)[:80],
    )


def test_a_bug_in_a_job_is_noted_or_at_least_printed_and_takes_no_other_down(tmp_path, capsys):
    def job():
        raise ZeroDivisionError("by zero")

    note = note_of(tmp_path, ("a=1",))
    run_job(note, job, is_here=True)
    assert note.read_text() == "ZeroDivisionError: by zero"
    assert "Traceback" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    run_job(tmp_path / "file" / "note", dict, is_here=True)
    assert capsys.readouterr().err == f"error: [Errno 17] File exists: '{tmp_path / 'file'}'\n"


@pytest.mark.parametrize(
    ("where", "error"),
    [
        ("runs_folder=/proc/none", "[Errno 2] No such file or directory: '/proc/none'"),
        ("hydra.sweep.dir=file", "[Errno 17] File exists: 'file'"),
    ],
)
def test_a_folder_that_cannot_be_used_is_an_error_in_one_line(tmp_path, train_here, where, error):
    (tmp_path / "file").write_text("")
    result = train_here("-m", "seed=0,1", where)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"error: {error}")


def test_a_comparison_that_cannot_be_written_is_an_error_in_one_line(tmp_path, run_here):
    make_run(tmp_path / "here" / "run")
    (tmp_path / "here" / "comparison.csv").mkdir()
    result = run_here("train.py", "seed=-1,-2", "hydra.sweep.dir=here", "-m")  # may come last
    assert result.returncode == 2
    assert "failed: job 2 of 2: seed=-2: seed must be a whole number from 0 to" in result.stderr
    assert "error: [Errno 21] Is a directory: " in result.stderr
    assert "Traceback" not in result.stderr


def _only_sweep(folder):
    (sweep,) = (folder / "runs" / "sweeps").iterdir()
    return sweep


@pytest.mark.slow
def test_a_signal_that_comes_too_late_for_a_job_ends_the_sweep(tmp_path, train_here, monkeypatch):
    evaluate = RunCallback._evaluate

    def interrupted(callback):
        os.kill(os.getpid(), signal.SIGTERM)
        return evaluate(callback)

    monkeypatch.setattr(RunCallback, "_evaluate", interrupted)  # once, at the end of each job
    result = train_here("-m", "seed=0,1", "hydra.sweep.dir=here", "training.evaluation_interval=64")
    assert result.returncode == 128 + signal.SIGTERM
    (run,) = (tmp_path / "here").glob("*_target_*")
    assert read_run(run).state == "finished"


@pytest.mark.slow
def test_a_job_that_fails_in_another_process_takes_no_other_down(tmp_path):
    (tmp_path / "swept_terms.py").write_text(
        "from flyrl.tasks import RewardTerm\n"
        "BONUS = RewardTerm('bonus', 1.0, lambda state: state.fly.position_w[:, 2], 'mm')\n"
    )
    terms = "task.terms=[no_terms:X],[swept_terms:BONUS],[]"  # a user's own, too
    process = _started(tmp_path, "launcher=submitit", terms, "seed=0")
    output, errors = process.communicate()
    assert process.returncode == 1, errors
    assert "failed: job 1 of 3: task.terms=[no_terms:X]: task.terms[0] is" in errors
    sweep = _only_sweep(tmp_path)
    assert output.splitlines()[-1] == f"sweep: {sweep.relative_to(tmp_path)}"
    (run,) = sweep.glob("*_target_flat_ppo_0_terms-swept_terms-BONUS")
    assert read_run(run).state == "finished"
    assert (sweep / "learning_curves.svg").is_file()
    command = (run / "command.txt").read_text()
    assert "task.terms=[swept_terms" in command
    assert "launcher" not in command
    with (sweep / "comparison.csv").open(newline="") as file:
        rows = {(row["task.terms"], row["runs"]) for row in csv.DictReader(file)}
    assert rows == {("[]", "1"), ("['swept_terms:BONUS']", "1")}


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "ray"])
def test_an_interrupted_sweep_says_how_to_go_on(tmp_path, launcher):
    process = _started(tmp_path, f"launcher={launcher}", "training.total_timesteps=1000000")
    deadline = time.monotonic() + 240
    while not any(tmp_path.glob("runs/sweeps/*/*/checkpoints/[!.]*.pt")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + signal.SIGTERM
    sweep = _only_sweep(tmp_path)
    assert f"the same command with hydra.sweep.dir={sweep.relative_to(tmp_path)}" in errors
    (run,) = sweep.glob("*_target_*")
    assert read_run(run).state == "interrupted"


@pytest.mark.slow
def test_a_sweep_started_again_leaves_resumes_and_starts(tmp_path, train_here):
    """Of three runs the first is finished, the second interrupted, the third asked for later."""
    sweep = tmp_path / "here"
    asked = ("-m", "hydra.sweep.dir=here", "training.total_timesteps=512")
    asked += ("training.evaluation_interval=512",)

    def interrupt():
        deadline = time.monotonic() + 240
        while time.monotonic() < deadline:
            if sum(file.stat().st_size > 0 for file in sweep.glob("*/progress.csv")) == 2:
                os.kill(os.getpid(), signal.SIGTERM)
                return
            time.sleep(0.01)

    thread = threading.Thread(target=interrupt)
    thread.start()
    result = train_here(*asked, "seed=0,1")
    thread.join()
    assert result.returncode == 128 + signal.SIGTERM
    assert "failed: job 2 of 2: seed=1: interrupted" in result.stderr
    assert "the same command with hydra.sweep.dir=here" in result.stderr
    first, second = sorted(sweep.glob("*_target_*"), key=lambda run: run.name[-1])
    assert [read_run(run).state for run in (first, second)] == ["finished", "interrupted"]
    assert 0 < read_run(second).decisions < 512
    result = train_here(*asked, "seed=0,1,2")
    assert result.returncode == 0, result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    runs = sorted(sweep.glob("*_target_*"), key=lambda run: run.name[-1])
    assert runs[:2] == [first, second]
    assert [read_run(run).decisions for run in runs] == [512] * 3
    commands = [len((run / "command.txt").read_text().splitlines()) for run in runs]
    assert commands == [1, 2, 1]


def _worker_at_work(driver, sweep):
    """A process of Ray's that has written a checkpoint of a run and is still training."""
    deadline = time.monotonic() + 300  # Ray and its workers start slowly beside other tests
    while time.monotonic() < deadline and driver.poll() is None:
        # a file with a dot in front is still being written
        begun = {file.parents[1] for file in sweep.glob("*/checkpoints/[!.]*.pt")}
        for process in psutil.Process(driver.pid).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                locked = {Path(file.path).parent for file in process.open_files()}
                if begun & locked:
                    return process
        time.sleep(0.1)
    raise AssertionError("no worker trains")


@pytest.mark.slow
def test_a_run_whose_worker_is_killed_is_not_lost_to_ray(tmp_path, train_here):
    asked = [
        "training.total_timesteps=1024",
        "training.checkpoint_interval=256",
        "training.evaluation_interval=1024",
    ]
    with _started(tmp_path, "launcher=ray", *asked, "hydra.sweep.dir=on_ray") as driver:
        try:
            _worker_at_work(driver, tmp_path / "on_ray").kill()
            _, errors = driver.communicate(timeout=300)
        finally:
            driver.terminate()
    assert driver.returncode == 0, errors
    assert train_here("-m", *asked, "hydra.sweep.dir=here").returncode == 0
    ours, theirs = (next((tmp_path / name).glob("*_ppo_0")) for name in ("on_ray", "here"))
    assert read_run(ours).state == "finished"
    assert "resumed" in read_run(ours).provenance
    assert (ours / "last.safetensors").read_bytes() == (theirs / "last.safetensors").read_bytes()


def test_ray_is_asked_for_no_more_than_the_machine_has(train_here, monkeypatch):
    two_cores = types.SimpleNamespace(
        init=lambda *_, **__: None,
        cluster_resources=lambda: {"CPU": 2.0},
        shutdown=lambda: None,
    )
    monkeypatch.setitem(sys.modules, "ray", two_cores)
    for name in ("RAY_USAGE_STATS_ENABLED", "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"):
        monkeypatch.setenv(name, "0")  # the launcher sets them
    result = train_here("launcher=ray", "seed=0,1", "hydra.launcher.num_cpus=3")
    assert result.returncode == 2
    message = "error: hydra.launcher.num_cpus must be at most 2, the CPUs of this machine, got 3\n"
    assert message in result.stderr
    assert "Traceback" not in result.stderr
