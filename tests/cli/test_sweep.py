import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
import types
from pathlib import Path

import numpy as np
import psutil
import pytest
from safetensors.numpy import load_file

from flyrl.cli.entry import job_names, note_of, run_job
from flyrl.policies import load_policy
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


def _interrupted(monkeypatch, method, is_time=lambda callback: True):
    """Send SIGTERM to this process where a method of a run's callback is called."""
    usual = getattr(RunCallback, method)

    def interrupted(callback):
        if is_time(callback):
            os.kill(os.getpid(), signal.SIGTERM)
        return usual(callback)

    monkeypatch.setattr(RunCallback, method, interrupted)


@pytest.mark.slow
def test_a_signal_that_comes_too_late_for_a_job_ends_the_sweep(tmp_path, train_here, monkeypatch):
    _interrupted(monkeypatch, "_evaluate")  # once, at the end of each job
    result = train_here("-m", "seed=0,1", "hydra.sweep.dir=here", "training.evaluation_interval=64")
    assert result.returncode == 128 + signal.SIGTERM
    (run,) = (tmp_path / "here").glob("*_target_*")
    assert read_run(run).state == "finished"


@pytest.mark.slow
def test_a_job_that_fails_in_another_process_takes_no_other_down(tmp_path, train_here):
    (tmp_path / "swept_terms.py").write_text(
        "from flyrl.tasks import RewardTerm\n"
        "BONUS = RewardTerm('bonus', 1.0, lambda state: state.fly.position_w[:, 2], 'mm')\n"
    )
    terms = "task.terms=[no_terms:X],[swept_terms:BONUS]"  # a user's own, too
    result = train_here("launcher=submitit", terms, "seed=0")
    assert result.returncode == 1, result.stderr
    assert "failed: job 1 of 2: task.terms=[no_terms:X]: task.terms[0] is" in result.stderr
    (sweep,) = (tmp_path / "runs" / "sweeps").iterdir()
    assert result.stdout.splitlines()[-1] == f"sweep: {sweep.relative_to(tmp_path)}"
    (run,) = sweep.glob("*_target_flat_ppo_0_terms-swept_terms-BONUS")
    assert read_run(run).state == "finished"
    assert (sweep / "learning_curves.svg").is_file()
    command = (run / "command.txt").read_text()
    assert "task.terms=[swept_terms" in command
    assert "launcher" not in command


@pytest.mark.slow
def test_an_interrupted_sweep_on_joblib_says_how_to_go_on(tmp_path, train_here):
    def interrupt():
        deadline = time.monotonic() + 240
        while not any(tmp_path.glob("here/*/checkpoints/[!.]*.pt")) and time.monotonic() < deadline:
            time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=interrupt).start()
    asked = ("launcher=joblib", "training.total_timesteps=1000000", "hydra.sweep.dir=here")
    result = train_here(*asked)
    assert result.returncode == 128 + signal.SIGTERM
    assert "the same command with hydra.sweep.dir=here" in result.stderr
    (run,) = (tmp_path / "here").glob("*_target_*")
    assert read_run(run).state == "interrupted"


@pytest.mark.slow
def test_a_sweep_started_again_leaves_resumes_and_starts(tmp_path, train_here, monkeypatch):
    """Of three runs the first is finished, the second interrupted, the third asked for later."""
    sweep = tmp_path / "here"
    asked = ("-m", "hydra.sweep.dir=here")
    with monkeypatch.context() as patch:
        _interrupted(patch, "_on_step", lambda run: run.n_calls == 3 and any(sweep.glob("*_1")))
        result = train_here(*asked, "seed=0,1")
    assert result.returncode == 128 + signal.SIGTERM
    assert "failed: job 2 of 2: seed=1: interrupted" in result.stderr
    assert "the same command with hydra.sweep.dir=here" in result.stderr
    first, second = sorted(sweep.glob("*_target_*"), key=lambda run: run.name[-1])
    assert [read_run(run).state for run in (first, second)] == ["finished", "interrupted"]
    assert 0 < read_run(second).decisions < 64
    result = train_here(*asked, "seed=0,1,2")
    assert result.returncode == 0, result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    runs = sorted(sweep.glob("*_target_*"), key=lambda run: run.name[-1])
    assert runs[:2] == [first, second]
    assert [read_run(run).decisions for run in runs] == [64] * 3
    commands = [len((run / "command.txt").read_text().splitlines()) for run in runs]
    assert commands == [1, 2, 1]


def _worker_at_work(driver, sweep, but=None):
    """A process of Ray's, another than `but`, that has written a checkpoint and still trains."""
    deadline = time.monotonic() + 300  # Ray and its workers start slowly beside other tests
    while time.monotonic() < deadline and driver.poll() is None:
        # a file with a dot in front is still being written
        begun = {file.parents[1] for file in sweep.glob("*/checkpoints/[!.]*.pt")}
        for process in psutil.Process(driver.pid).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                locked = {Path(file.path).parent for file in process.open_files()}
                if process != but and begun & locked:
                    return process
        time.sleep(0.5)
    raise AssertionError("no worker trains")


@pytest.mark.slow
def test_ray_resumes_a_run_whose_worker_is_killed_and_an_interrupted_sweep_says_how_to_go_on(
    tmp_path, train_here
):
    sweep = tmp_path / "on_ray"
    with _started(
        tmp_path, "launcher=ray", "training.total_timesteps=1000000", "hydra.sweep.dir=on_ray"
    ) as driver:
        try:
            killed = _worker_at_work(driver, sweep)
            killed.kill()
            _worker_at_work(driver, sweep, but=killed)
            (run,) = sweep.glob("*_ppo_0")
            while "resumed" not in read_run(run).provenance:
                time.sleep(0.1)
            driver.send_signal(signal.SIGTERM)
            _, errors = driver.communicate(timeout=120)
        finally:
            driver.terminate()
    assert driver.returncode == 128 + signal.SIGTERM, errors
    assert "the same command with hydra.sweep.dir=on_ray" in errors
    assert read_run(run).state == "interrupted"
    # as far as it came, it is one that nothing happened to
    decisions = load_policy(run / "last.safetensors").bundle.training["decisions"]
    updates = decisions // 32
    assert train_here(f"training.total_timesteps={updates * 32}").returncode == 0
    (whole,) = tmp_path.glob("runs/*_ppo_0")
    ours, theirs = (load_file(each / "last.safetensors") for each in (run, whole))
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values)


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
