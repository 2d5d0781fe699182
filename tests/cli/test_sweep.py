import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from flyrl.cli.arguments import Sweep
from flyrl.cli.errors import Failure
from flyrl.cli.sweep import (
    Interrupted,
    by_key,
    folder_labels,
    read_jobs,
    run_job,
    run_sweep,
    swept_keys,
    titles,
)
from flyrl.training.callback import RunCallback
from flyrl.training.runs import read_run
from tests.tiny import TINY_ARGUMENTS

ROOT = Path(__file__).parents[2]
TINY = (*TINY_ARGUMENTS, "training.evaluation_episodes=1", "video_after=false")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def _tiny(*arguments):
    """The arguments, with what makes a training tiny where they ask for nothing else."""
    asked = {argument.partition("=")[0] for argument in arguments}
    return [*arguments, *(one for one in TINY if one.partition("=")[0] not in asked)]


def _train(folder, *arguments):
    return subprocess.run(
        [sys.executable, str(ROOT / "train.py"), *_tiny(*arguments)],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def train_here(run_here):
    """The same in this process; not for other launchers."""
    return lambda *arguments: run_here("train.py", *_tiny(*arguments))


def _sweep(folder, jobs):
    (folder / "sweep.json").write_text(json.dumps({"commands": [], "jobs": jobs}))


def test_what_is_swept():
    jobs = [("seed=0", "algo=ppo", "x=1"), ("seed=1", "algo=ppo", "x=1", "+y=2")]
    assert swept_keys(jobs) == ["seed", "y"]
    assert titles(jobs)[jobs[1]] == "job 2 of 2: seed=1 y=2"
    assert by_key([r"task.terms=[my_terms\:HEIGHT]"]) == {"task.terms": "[my_terms:HEIGHT]"}


def test_folders_are_named_by_swept_values_that_any_file_system_takes():
    long = f"+task.terms=['{'x' * 300}:Y']"
    jobs = [
        ("seed=0", "algo=ppo", "algo.gamma=0.99", "algo.hidden_layers=[64,64]", "x=1"),
        ("seed=1", "algo=sac", "algo.gamma=0.9", r"evaluation.policies=[a/b\:é]", "x=1"),
        ("seed=2", "algo=sac", "algo.gamma=0.9", long, "x=1"),
    ]
    labels = folder_labels(jobs)
    assert labels[jobs[0]] == "gamma-0.99_hidden_layers-64-64"
    assert labels[jobs[1]] == "gamma-0.9_policies-a-b"
    assert labels[jobs[2]] == ("gamma-0.9_terms--" + "x" * 80)[:80]
    assert folder_labels([("seed=0",), ("seed=1",)]) == {("seed=0",): "", ("seed=1",): ""}


def _fail():
    raise Failure("seed must be one of mine")


def _break():
    raise ZeroDivisionError("by zero")


def test_a_job_that_fails_is_noted_and_raises_nothing(tmp_path, capsys):
    jobs = {("a=1",): _fail, ("a=2",): _break, ("a=3",): lambda: tmp_path / "run"}
    _sweep(tmp_path, list(jobs))
    for job, function in jobs.items():
        run_job(tmp_path, Path.cwd(), job, "", function)
    notes = [note for _, note in read_jobs(tmp_path)]
    assert [note.error for note in notes] == [
        "seed must be one of mine",
        "ZeroDivisionError: by zero",
        None,
    ]
    assert notes[2].folder == "run"
    assert "Traceback" in capsys.readouterr().err


def test_an_interrupted_job_ends_the_sweep_only_in_its_own_process(tmp_path, monkeypatch):
    def interrupted():
        raise Interrupted(tmp_path / "run", signal.SIGTERM)

    _sweep(tmp_path, [["a=1"]])
    run_job(tmp_path, Path.cwd(), ("a=1",), "", interrupted)
    assert read_jobs(tmp_path)[0][1].error == "interrupted"
    monkeypatch.setenv("FLYRL_SWEEP_PROCESS", str(os.getpid()))
    with pytest.raises(Interrupted):
        run_job(tmp_path, Path.cwd(), ("a=1",), "", interrupted)


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


@pytest.mark.parametrize(
    ("record", "key"),
    [
        ([], "commands"),
        ({"commands": 5, "jobs": [["a=1"]]}, "commands"),
        ({"commands": []}, "jobs"),
        ({"commands": [], "jobs": []}, "jobs"),
        ({"commands": [], "jobs": "abc"}, "jobs"),
        ({"commands": [], "jobs": [["a=1"], "b=2"]}, "jobs"),
        ({"commands": [], "jobs": [["a=1", None]]}, "jobs"),
    ],
)
def test_a_damaged_sweep_file_names_file_and_key(tmp_path, record, key):
    (tmp_path / "sweep.json").write_text(json.dumps(record))
    with pytest.raises(ValueError, match=rf"sweep\.json: '{key}' must be a list"):
        read_jobs(tmp_path)


@pytest.mark.parametrize("note", ["{", "[]", '{"folder": 5, "error": null}'])
def test_a_damaged_note_counts_as_none(tmp_path, note):
    _sweep(tmp_path, [["a=1"]])
    run_job(tmp_path, Path.cwd(), ("a=1",), "", lambda: tmp_path / "run")
    (file,) = (tmp_path / "jobs").iterdir()
    file.write_text(note)
    assert read_jobs(tmp_path) == [(("a=1",), None)]


def test_a_job_without_a_note_has_not_ended(tmp_path):
    _sweep(tmp_path, [["a=1"]])
    assert read_jobs(tmp_path) == [(("a=1",), None)]


def test_a_note_that_cannot_be_written_raises_nothing(tmp_path, capsys):
    _sweep(tmp_path, [["a=1"]])
    (tmp_path / "jobs").write_text("a file")
    run_job(tmp_path, Path.cwd(), ("a=1",), "", lambda: tmp_path / "run")
    assert capsys.readouterr().err.splitlines()[1:] == [
        f"error: [Errno 17] File exists: '{tmp_path / 'jobs'}'"
    ]
    assert read_jobs(tmp_path) == [(("a=1",), None)]


@pytest.mark.parametrize(
    ("where", "error"),
    [
        ("runs_folder=/proc/none", "[Errno 2] No such file or directory: '/proc/none'"),
        ("hydra.sweep.dir=file", "[Errno 17] File exists: 'file'"),
        ("hydra.sweep.dir=broken", "broken is not the folder of a sweep: "),
    ],
)
def test_a_folder_that_cannot_be_used_is_an_error_in_one_line(tmp_path, train_here, where, error):
    (tmp_path / "file").write_text("")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "sweep.json").write_text("{")
    result = train_here("-m", "seed=0,1", where)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"error: {error}")


def test_the_option_for_a_sweep_may_come_last(run_here):
    result = run_here("train.py", "seed=-1,-2", "-m")
    assert result.returncode == 1
    assert "failed: job 2 of 2: seed=-2: seed must be a whole number from 0 to" in result.stderr


def test_a_comparison_that_cannot_be_written_is_an_error_in_one_line(tmp_path, monkeypatch, capsys):
    def at_end(folder):
        raise OSError(28, "No space left on device", str(folder / "comparison.csv"))

    monkeypatch.setenv("FLYRL_SWEEP_PROCESS", "")
    with pytest.raises(SystemExit) as end:
        run_sweep(Sweep(tmp_path, True, (), False), ["train.py"], lambda: None, at_end)
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"error: [Errno 28] No space left on device: '{tmp_path / 'comparison.csv'}'"


def _only_sweep(folder):
    (sweep,) = (folder / "runs" / "sweeps").iterdir()
    return sweep


@pytest.mark.slow
@pytest.mark.parametrize("how", ["-m", "launcher=submitit"])
def test_one_failing_job_takes_no_other_down(tmp_path, train_here, how):
    asked = (how, "algo.gamma=2,0.9")
    result = train_here(*asked) if how == "-m" else _train(tmp_path, *asked)
    assert result.returncode == 1, result.stderr
    message = "algo.gamma must be a finite number from 0 to 1, got 2.0\n"
    assert f"failed: job 1 of 2: algo.gamma=2: {message}" in result.stderr
    sweep = _only_sweep(tmp_path)
    assert result.stdout.splitlines()[-1] == f"sweep: {sweep.relative_to(tmp_path)}"
    (run,) = sweep.glob("*_target_flat_ppo_0_gamma-0.9")
    assert read_run(run).state == "finished"
    assert (sweep / "learning_curves.svg").is_file()
    command = (run / "command.txt").read_text()
    assert "algo.gamma=0.9" in command
    assert "launcher" not in command
    with (sweep / "comparison.csv").open(newline="") as file:
        assert [(row["algo.gamma"], row["runs"]) for row in csv.DictReader(file)] == [
            ("0.9", "1"),
            ("2", "0"),
        ]


@pytest.mark.slow
def test_a_sweep_grows_in_its_folder_and_leaves_what_is_finished(tmp_path, train_here):
    assert train_here("-m", "seed=0", "hydra.sweep.dir=here").returncode == 0
    before = {path.name for path in (tmp_path / "here").glob("*_target_*")}
    result = train_here("-m", "seed=0,1", "hydra.sweep.dir=here")
    assert result.returncode == 0, result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    after = {path.name for path in (tmp_path / "here").glob("*_target_*")}
    assert len(before) == 1
    assert before < after
    assert {name.rsplit("_", 1)[1] for name in after} == {"0", "1"}
    assert len(after) == 2
    assert len(json.loads((tmp_path / "here" / "sweep.json").read_text())["commands"]) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "number"),
    [("launcher=joblib", signal.SIGTERM), ("launcher=ray", signal.SIGTERM)],
)
def test_an_interrupted_sweep_says_how_to_go_on(tmp_path, how, number):
    endless = ["training.total_timesteps=1000000", "seed=0,1"]
    command = [sys.executable, str(ROOT / "train.py"), *_tiny(how, *endless)]
    process = subprocess.Popen(
        command, cwd=tmp_path, env=ENVIRONMENT, text=True, stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 240
    while not any(tmp_path.glob("runs/sweeps/*/*/checkpoints/[!.]*.pt")):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.2)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + number
    sweep = _only_sweep(tmp_path)
    assert f"the same command with hydra.sweep.dir={sweep.relative_to(tmp_path)}" in errors
    states = {read_run(path).state for path in sweep.glob("*_target_*")}
    assert states == {"interrupted"}


@pytest.mark.slow
def test_a_sweep_started_again_goes_on_with_what_was_interrupted(tmp_path, train_here):
    sweep = tmp_path / "here"
    asked = ("-m", "seed=0,1", "hydra.sweep.dir=here", "training.total_timesteps=512")

    def interrupt():
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            if any(file.stat().st_size for file in sweep.glob("*/progress.csv")):
                os.kill(os.getpid(), signal.SIGTERM)
                return
            time.sleep(0.002)

    thread = threading.Thread(target=interrupt)
    thread.start()
    result = train_here(*asked)
    thread.join()
    assert result.returncode == 128 + signal.SIGTERM
    assert "the same command with hydra.sweep.dir=here" in result.stderr
    notes = [note for _, note in read_jobs(sweep)]
    assert notes[0].error == "interrupted"
    assert notes[1] is None
    (first,) = sweep.glob("*_target_*")
    assert 0 < read_run(first).decisions < 512
    result = train_here(*asked)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name[-2:] for path in sweep.glob("*_target_*")) == ["_0", "_1"]
    assert {read_run(path).decisions for path in sweep.glob("*_target_*")} == {512}
    assert len((first / "command.txt").read_text().splitlines()) == 2


@pytest.mark.slow
def test_terms_of_your_own_can_be_swept(tmp_path, train_here):
    (tmp_path / "swept_terms.py").write_text(
        "from flyrl.tasks import RewardTerm\n"
        "BONUS = RewardTerm('bonus', 1.0, lambda state: state.fly.position_w[:, 2], 'mm')\n"
    )
    result = train_here("-m", "task.terms=[],[swept_terms:BONUS]")
    assert result.returncode == 0, result.stderr
    sweep = _only_sweep(tmp_path)
    terms = [read_run(path).setting("task.terms") for path in sorted(sweep.glob("*_target_*"))]
    assert terms == [[], ["swept_terms:BONUS"]]
    assert "job 2 of 2: task.terms=[swept_terms:BONUS]\n" in result.stderr
    with (sweep / "comparison.csv").open(newline="") as file:
        assert [(row["task.terms"], row["runs"]) for row in csv.DictReader(file)] == [
            ("[]", "1"),
            ("[swept_terms:BONUS]", "1"),
        ]


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


def _parameters(sweep):
    """The last policies of a sweep's two runs, by seed."""
    return {
        read_run(run).setting("seed"): (run / "last.safetensors").read_bytes()
        for run in sweep.glob("*_target_flat_ppo_?")
    }


@pytest.mark.slow
def test_a_run_whose_worker_is_killed_is_not_lost_to_ray(tmp_path, train_here):
    asked = [
        "seed=0,1",
        "training.total_timesteps=1024",
        "training.checkpoint_interval=256",
        "training.evaluation_interval=1024",
    ]
    command = [*_tiny("launcher=ray", *asked), "hydra.sweep.dir=on_ray"]
    with subprocess.Popen(
        [sys.executable, str(ROOT / "train.py"), *command],
        cwd=tmp_path,
        env=ENVIRONMENT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    ) as driver:
        try:
            _worker_at_work(driver, tmp_path / "on_ray").kill()
            output, _ = driver.communicate(timeout=300)
        finally:
            driver.terminate()
    assert driver.returncode == 0, output
    runs = [read_run(run) for run in (tmp_path / "on_ray").glob("*_target_flat_ppo_?")]
    assert [run.state for run in runs] == ["finished"] * 2
    assert sorted("resumed" in run.provenance for run in runs) == [False, True]
    assert train_here("-m", *asked, "hydra.sweep.dir=here").returncode == 0
    assert _parameters(tmp_path / "on_ray") == _parameters(tmp_path / "here")


def test_ray_is_asked_for_no_more_than_the_machine_has(tmp_path):
    result = _train(tmp_path, "launcher=ray", "seed=0,1", "hydra.launcher.num_cpus=999")
    assert result.returncode == 2
    assert "error: hydra.launcher.num_cpus must be at most" in result.stderr
    assert "Traceback" not in result.stderr
