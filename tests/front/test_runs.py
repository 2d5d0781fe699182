"""Trainings from Python: the settings and the bits of the command line, and what a run gives."""

import signal
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from safetensors.numpy import load_file

import flyrl
from flyrl.cli.arguments import composed
from flyrl.cli.config import training_config
from flyrl.evaluation import EvaluationConfig
from flyrl.front.runs import TrainingInterrupted, learn, simulated_shares
from flyrl.tasks import TASKS
from flyrl.training.config import config_from_keywords, training_record
from flyrl.training.run_folder import checkpoint_file, create_folder
from flyrl.training.runs import read_record
from tests.tiny import TINY_ARGUMENTS
from tests.training.folders import interrupted_at

SHORT_TARGET = replace(TASKS["target"](), time_limit_s=0.2)
TINY = {
    key.rpartition(".")[2]: yaml.safe_load(value)
    for key, _, value in (word.partition("=") for word in TINY_ARGUMENTS)
    if not key.startswith("task.")
}
TINY["video_after"] = False


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return flyrl.train(SHORT_TARGET, runs_folder=tmp_path_factory.mktemp("runs"), **TINY)


def test_python_and_command_line_train_the_same_bits(run, run_here, tmp_path):
    done = run_here("train.py", *TINY_ARGUMENTS)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / done.stdout.splitlines()[-1].removeprefix("run: ")
    # the run folder, and no output of Hydra's
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]
    assert "train.py physics=fast" in (folder / "command.txt").read_text()
    assert (folder / "learning_curve.svg").is_file()
    assert (folder / "best.mp4").is_file() != ("Videos are left out: " in done.stderr)
    assert read_record(run.folder) == read_record(folder)
    ours, theirs = (load_file(each / "last.safetensors") for each in (run.folder, folder))
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name])


@pytest.mark.parametrize(("terrain", "cost"), [("slope", 1), ("hills", 2), ("any", 2)])
def test_rough_ground_takes_twice_the_time_of_a_plane(terrain, cost):
    on_flat, on_ground = (
        simulated_shares(
            config_from_keywords("target", terrain=each),
            EvaluationConfig(terrains=(each,)),
            (),
            videos=False,
        )
        for each in ("flat", terrain)
    )
    for part in ("training", "evaluating"):
        assert on_ground[part] == cost * on_flat[part]
    assert on_ground["reporting"] == on_flat["reporting"]


def test_settings_are_those_of_the_command_line_and_a_keyword_beats_the_tuned_one():
    theirs = training_config(composed("train", ["task=hybrid_turning"]))  # without a time limit
    assert training_record(config_from_keywords("hybrid_turning")) == training_record(theirs)
    config = config_from_keywords("traverse", gamma=0.5, num_envs=8)
    assert (config.algo.settings["gamma"], config.algo.settings["log_std_init"]) == (0.5, -1.5)
    assert (config.training.num_envs, config.training.teacher) == (8, "pursuit")


def test_an_earlier_name_is_understood():
    assert config_from_keywords(total_decisions=5) == config_from_keywords(total_timesteps=5)
    with pytest.raises(ValueError, match="both are given"):
        config_from_keywords(total_decisions=5, total_timesteps=9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"learning_rat": 1e-3}, "did you mean 'learning_rate'"),
        ({"terain": "flat"}, "did you mean 'terrain'"),
        ({"buffer_size": 1000}, "'buffer_size', which is one of sac, tqc"),
        ({"algo": "poo"}, "did you mean 'ppo'"),
        ({"task": "targt"}, "did you mean 'target'"),
        ({"logger": "wandbb"}, "did you mean 'wandb'"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_before_any_work(given, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        flyrl.train(runs_folder=tmp_path / "runs", **given)
    assert not (tmp_path / "runs").exists()


def test_a_run_has_its_learning_curve_as_a_table_and_loads_its_policy(run):
    curve = run.learning_curve
    assert isinstance(curve, pd.DataFrame)
    assert list(curve.decisions) == [32, 64]
    assert curve.success_rate.between(0, 1).all()
    assert "unweighted_progress" in curve
    assert 'src="data:image/svg+xml;base64,' in run._repr_html_()
    assert run.policy("last").bundle.training["decisions"] == 64
    action, _ = run.policy().predict(flyrl.make("target").reset(seed=0)[0])
    assert action.shape == (2,)
    with pytest.raises(ValueError, match="which must be one of 'best', 'last'"):
        run.policy("first")


def test_ctrl_c_ends_a_training_in_order_and_it_is_resumed_to_the_same_bits(run, tmp_path):
    with interrupted_at(3, signal.SIGINT), pytest.raises(TrainingInterrupted) as caught:
        flyrl.train(SHORT_TARGET, runs_folder=tmp_path, **TINY)
    part = caught.value.run
    assert isinstance(caught.value, KeyboardInterrupt)
    assert part.interrupted_by == signal.SIGINT
    assert 32 <= part.policy("last").bundle.training["decisions"] < 64
    with pytest.raises(ValueError, match=r"seed is 0 in its config\.yaml, not 1"):
        flyrl.train(SHORT_TARGET, resume=part, **TINY | {"seed": 1})
    resumed = flyrl.train(SHORT_TARGET, resume=part, **TINY)
    assert resumed.folder == part.folder
    ours, theirs = (load_file(each.folder / "last.safetensors") for each in (resumed, run))
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values)


def test_an_error_of_the_system_says_how_to_resume_once_there_is_a_checkpoint(
    tmp_path, monkeypatch
):
    """A full disk, which nothing here can fill."""
    config = config_from_keywords(SHORT_TARGET, physics="fast", num_envs=4)
    full = OSError(28, "No space left on device")

    def fail(*_, **__):
        raise full

    monkeypatch.setattr("flyrl.front.runs.start", fail)
    run = create_folder(config, tmp_path)
    with pytest.raises(OSError, match="No space") as caught:
        learn(config, tmp_path)
    assert caught.value is full
    checkpoint_file(run, 64).write_text("")
    told = f"{full}; once {run} can be written to, resume with: resume={run}"
    with pytest.raises(OSError, match="No space") as caught:
        learn(config, tmp_path)
    assert str(caught.value) == told
