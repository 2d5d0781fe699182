import csv
import os
import shlex
import shutil
import signal
import sys
import threading
import time

import optuna
import pytest

from flyrl.cli.config import training_config
from flyrl.cli.main import main
from flyrl.cli.tune import compose_training
from flyrl.front.study import score, search_space
from flyrl.training.config import training_record
from flyrl.training.runs import find_runs, read_run
from tests.tiny import TINY_ARGUMENTS

TINY = (
    *(argument for argument in TINY_ARGUMENTS if not argument.startswith("algo.")),
    "training.total_timesteps=96",
    "training.num_envs=2",
    "training.evaluation_episodes=1",
    "algo.n_steps=16",
    "algo.batch_size=32",
)
SPACE = """
algo.learning_rate: {low: 1e-4, high: 3e-2, log: true}
algo.n_epochs: {low: 1, high: 2}
algo.hidden_layers: {choices: [[8], [8, 8]]}
"""


def _tune(folder, *options, space=SPACE, overrides=(), runs=None):
    (folder / "space.yaml").write_text(space)
    search = ["--search", str(folder / "space.yaml")]
    return main(["tune", *options, *search, *TINY, f"runs_folder={runs or folder}", *overrides])


def _rows(folder, name):
    with (folder / "studies" / name / "study.csv").open() as table:
        return list(csv.DictReader(table))


def _drawn(rows):
    """Rows of trials that none other repeats, without what differs in time."""
    keys = ("state", "value", "params_algo.learning_rate", "params_algo.n_epochs")
    keys += ("params_algo.hidden_layers", "user_attrs_decisions")
    return [[row[key] for key in keys] for row in rows if row["state"] != "FAIL"]


def _load(folder, name):
    return optuna.load_study(
        study_name=name, storage=f"sqlite:///{folder / 'studies' / name / 'study.db'}"
    )


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A folder with a study of two trials, and what was printed."""
    folder = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["flyrl", "tune", "--name", "two"])
        assert _tune(folder, "--name", "two", "--trials", "2") == 0
    return folder


def test_every_trial_is_a_run_with_what_was_drawn(study):
    rows = _rows(study, "two")
    assert [row["state"] for row in rows] == ["COMPLETE"] * 2
    assert len({row["params_algo.learning_rate"] for row in rows}) == 2
    assert len(find_runs(study)) == 2
    for row in rows:
        run = read_run(study / "studies" / "two" / row["user_attrs_run"])
        assert run.state == "finished"
        assert run.setting("algo.learning_rate") == float(row["params_algo.learning_rate"])
        assert run.setting("algo.n_epochs") == int(row["params_algo.n_epochs"])
        assert str(run.setting("algo.hidden_layers")) == row["params_algo.hidden_layers"]
        assert float(row["value"]) == score(run.best, 1)
        assert float(row["user_attrs_decisions"]) == run.best["decisions"]
        # its command trains it without the study
        program, *overrides = shlex.split((run.path / "command.txt").read_text())
        assert program == "flyrl-train"
        assert training_record(training_config(compose_training(overrides))) == run.settings
    noted = _load(study, "two").user_attrs
    assert noted["commands"] == ["flyrl tune --name two"]
    assert noted["record"]["settings"]["training"]["total_timesteps"] == 96


def test_the_same_command_shows_the_study_and_trains_nothing(study, capsys):
    rows = _rows(study, "two")
    assert _tune(study, "--name", "two", "--trials", "2") == 0
    assert len(find_runs(study)) == 2
    assert _rows(study, "two") == rows
    best = max(rows, key=lambda row: float(row["value"]))
    output = capsys.readouterr().out
    (line,) = [line for line in output.splitlines() if line.startswith("best: ")]
    _, *overrides = shlex.split(line.removeprefix("best: "))
    settings = training_record(training_config(compose_training(overrides)))
    assert settings == read_run(study / "studies" / "two" / best["user_attrs_run"]).settings
    assert "2 trials: 2 complete" in output


def test_a_study_with_other_settings_is_another(study, capsys):
    for options, other, told in (
        ([], {"overrides": ["algo.gamma=0.5"]}, "settings.algo.gamma is 0.995, now 0.5"),
        ([], {"space": SPACE.replace("3e-2", "4e-2")}, "attributes.high is 0.03, now 0.04"),
        (["--seed", "1"], {}, "seed is 0, now 1"),
    ):
        assert _tune(study, "--name", "two", "--trials", "2", *options, **other) == 2
        assert told in capsys.readouterr().err


def test_a_study_that_was_interrupted_and_killed_ends_as_one_that_was_not(study, tmp_path, capsys):
    folder = tmp_path / "studies" / "two"

    def interrupt():
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            if any(folder.glob("*/evaluations.csv")):
                os.kill(os.getpid(), signal.SIGTERM)
                return
            time.sleep(0.002)

    thread = threading.Thread(target=interrupt)
    thread.start()
    status = _tune(tmp_path, "--name", "two", "--trials", "2")
    thread.join()
    assert status == 128 + signal.SIGTERM
    assert "interrupted; resume with the same command" in capsys.readouterr().out
    (run,) = find_runs(folder)
    assert read_run(run).state == "interrupted"
    # what a kill after the checkpoint leaves, as it is resumed: a trial that runs, and a run
    left = _load(tmp_path, "two")
    left.ask(left.trials[0].distributions)
    (run / "status.json").unlink()
    assert _tune(tmp_path, "--name", "two", "--trials", "2") == 0
    assert _drawn(_rows(tmp_path, "two")) == _drawn(_rows(study, "two"))
    assert len(find_runs(tmp_path)) == 2


def test_a_trial_that_falls_behind_is_pruned(study, tmp_path):
    folder = shutil.copytree(study, tmp_path / "runs")
    before = _load(folder, "two")
    first = before.trials[0]
    far_better = {1: 50.0, 2: 50.0, 3: 50.0}
    for _ in range(2):
        before.add_trial(
            optuna.trial.create_trial(
                params=first.params,
                distributions=first.distributions,
                value=50.0,
                intermediate_values=far_better,
            )
        )
    longer = ("--name", "two", "--trials")
    assert _tune(tmp_path, *longer, "5", "--prune-after", "4", runs=folder) == 0
    last = _rows(folder, "two")[4]
    run = read_run(folder / "studies" / "two" / last["user_attrs_run"])
    assert last["state"] == "PRUNED"
    assert [row["decisions"] for row in run.evaluations] == [32, 64]
    assert '"interrupted_by": "pruning"' in (run.path / "status.json").read_text()
    assert _tune(tmp_path, *longer, "6", "--no-pruning", runs=folder) == 0
    assert _rows(folder, "two")[5]["state"] == "COMPLETE"


def test_a_trial_that_is_refused_fails_and_the_others_go_on(tmp_path, capsys):
    space = "algo.batch_size: {low: 16, high: 32}"  # of 32 decisions: 17 to 31 divide none
    assert _tune(tmp_path, "--name", "a", "--trials", "1", space=space) == 1
    captured = capsys.readouterr()
    assert "1 trials: 1 fail" in captured.out
    assert "trial 0 failed: ValueError: algo.batch_size" in captured.err
    assert find_runs(tmp_path) == []
    assert _tune(tmp_path, "--name", "a", "--trials", "2", space=space) == 0
    rows = _rows(tmp_path, "a")
    shown = [(row["state"], row["params_algo.batch_size"]) for row in rows]
    assert shown == [("FAIL", "25"), ("COMPLETE", "32")]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--trials", "0"], "--trials"),
        (["--name", "a/b"], "--name must be the name of a folder"),
        (["--search", "none"], "there is no search space none ("),
        (["algo=ddpg"], "search/ddpg.yaml ("),
        (["seed=0,1"], "takes no sweep, got seed=0,1"),
        (["evaluate_after=true"], "evaluate_after cannot be given"),
        (["training.num_envs=4"], "ppo.yaml allows algo."),
    ],
)
def test_what_cannot_be_meant_is_said_before_any_work(arguments, said, tmp_path, capsys):
    assert main(["tune", *arguments, f"runs_folder={tmp_path}"]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_without_optuna_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert main(["tune", "--trials", "1"]) == 2
    assert "pip install -e '.[optuna]'" in capsys.readouterr().err


def test_a_storage_that_cannot_be_used_is_an_error_in_one_line(study, tmp_path, capsys):
    shutil.copytree(study, tmp_path / "runs")
    (tmp_path / "runs" / "studies" / "two" / "study.db").write_text("no database " * 100)
    assert _tune(study, "--name", "two", "--trials", "2", runs=tmp_path / "runs") == 2
    assert capsys.readouterr().err == (
        f"error: {tmp_path}/runs/studies/two/study.db cannot be used: file is not a database\n"
    )


SETTINGS = {"algo": {"learning_rate": 1e-3, "n_epochs": 10}, "seed": 0}


@pytest.mark.parametrize(
    ("key", "given", "said"),
    [
        ("algo.learning_rat", {"low": 0, "high": 1}, "did you mean 'algo.learning_rate'"),
        ("seed", {"low": 0, "high": 9}, "seed cannot be searched"),
        ("algo.learning_rate", 1e-3, "must be {low, high} or {choices}, got 0.001"),
        ("algo.learning_rate", {"low": 1e-3}, "missing 1 required positional argument: 'high'"),
        ("algo.n_epochs", {"low": 1.5, "high": 3}, "must be whole numbers"),
    ],
)
def test_a_space_that_cannot_be_meant_so(key, given, said):
    with pytest.raises(ValueError, match=r"^mine\.yaml: ") as error:
        search_space({key: given}, SETTINGS, "mine.yaml")
    assert said in str(error.value)


def test_success_counts_first_and_equal_success_by_the_return():
    def of(success_rate, mean_return):
        return score({"success_rate": success_rate, "mean_return": mean_return}, 4)

    assert of(0.5, 0.0) == 0.5 + 0.5 / 4
    assert of(0.5, 1.0) == pytest.approx(0.5 + 0.75 / 4)  # atan(1) = pi / 4
    assert of(0.5, -1e6) < of(0.5, -1.0) < of(0.5, 2.0) < of(0.5, 1e6) < of(0.75, -1e6)
    evaluation = {"success_rate": 0.5, "mean_return": 1e6}
    assert score(evaluation, 4, has_one_reward=False) == 0.5
