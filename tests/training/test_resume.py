import multiprocessing
import shutil
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
import yaml

from flyrl.anatomy import LEGS
from flyrl.envs.core import EnvConfig
from flyrl.policies import load_policy
from flyrl.simulation.randomisation import RANDOMISATIONS
from flyrl.tasks import TASKS
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.callback import STOPPING
from flyrl.training.config import CurriculumConfig, TrainingConfig, training_record
from flyrl.training.learn import Run, resume, train
from flyrl.training.run_folder import load_checkpoint, save_checkpoint
from flyrl.training.runs import ResumeError, RunIsHeldError, held, read_rows, read_run
from tests.tiny import TINY, TINY_ENV
from tests.training.folders import before, interrupted_at, make_run

SCHEDULE = replace(
    TINY.training, total_timesteps=256, evaluation_interval=96, checkpoint_interval=64
)
PPO_CONFIG = replace(
    TINY, algo=TINY.algo.with_settings(learning_rate_decay=True), training=SCHEDULE
)
SAC_CONFIG = replace(
    PPO_CONFIG,
    algo=AlgorithmConfig(
        "sac", learning_starts=100, batch_size=16, gradient_steps=1, hidden_layers=(16,)
    ),
    training=replace(SCHEDULE, teacher="pursuit", demonstrations=40),
)
VARIED = replace(RANDOMISATIONS["default"], missing_leg=LEGS)
# with two episodes in a row, whatever comes of them, it gets harder
RANDOM_CONFIG = replace(
    PPO_CONFIG,
    env=replace(TINY_ENV, terrain="random_blocks", randomisation=VARIED),
    training=replace(
        SCHEDULE, curriculum=CurriculumConfig(enabled=True, step=0.06, window=2, raise_at=0.0)
    ),
)
WORM_CONFIG = replace(
    PPO_CONFIG,
    env=EnvConfig(replace(TASKS["worm_crawl"](), time_limit_s=0.5)),
    algo=AlgorithmConfig(
        "recurrent_ppo",
        n_steps=8,
        batch_size=16,
        n_epochs=2,
        lstm_hidden_size=8,
        normalize_observation=True,
        normalize_reward=True,
    ),
)
RESULTS = ("last.safetensors", "best.safetensors", "evaluations.csv")


def _results(run):
    return {name: (run.folder / name).read_bytes() for name in RESULTS}


@pytest.fixture(
    scope="module",
    params=[PPO_CONFIG, SAC_CONFIG, RANDOM_CONFIG, WORM_CONFIG],
    ids=["ppo", "sac", "random_flies_in_a_curriculum", "recurrent_ppo_with_worms"],
)
def runs(request, tmp_path_factory):
    """A whole run, one of the same settings that was interrupted and resumed, and that before."""
    config, folder = request.param, tmp_path_factory.mktemp("runs")
    whole = train(config, folder / "whole")
    with interrupted_at(27):
        part = train(config, folder / "part")
    state = read_run(part.folder).state
    policy = load_policy(part.folder / "last.safetensors")
    with (part.folder / "progress.csv").open("a") as table:
        table.write("12")  # as a kill may leave it
    resumed = resume(config, part.folder)
    return whole, resumed, (part, state, policy)


def test_a_resumed_run_ends_with_the_same_bits_and_logs_every_update_once(runs):
    whole, resumed, (part, state, policy) = runs
    assert part.interrupted_by == signal.SIGTERM
    assert state == "interrupted"
    assert 27 * 4 <= policy.bundle.training["decisions"] <= 36 * 4
    assert resumed.folder == part.folder
    assert _results(resumed) == _results(whole)
    assert _without_times(resumed.folder) == _without_times(whole.folder)


def _without_times(folder):
    times = {"time/fps", "time/time_elapsed", "time/iterations"}
    return [
        {key: value and float(value) for key, value in row.items() if key not in times}
        for row in read_rows(folder / "progress.csv")
    ]


def test_a_run_that_is_interrupted_in_its_last_rollout_is_resumed(tmp_path):
    # the last rollout goes beyond the total
    schedule = replace(SCHEDULE, total_timesteps=90, checkpoint_interval=10_000)
    config = replace(PPO_CONFIG, training=schedule)
    whole = train(config, tmp_path / "whole")
    with interrupted_at(22):
        part = train(config, tmp_path / "part")
    assert read_run(part.folder).state == "interrupted"
    assert _results(resume(config, part.folder)) == _results(whole)


def test_an_interrupted_run_says_once_that_it_stops_after_its_rollout(tmp_path, capsys):
    with interrupted_at(2):
        train(PPO_CONFIG, tmp_path)
    assert capsys.readouterr().err.count(STOPPING) == 1


def test_a_signal_during_the_last_evaluation_is_too_late(tmp_path):
    config = replace(PPO_CONFIG, training=replace(SCHEDULE, total_timesteps=32))
    with before("_evaluate", lambda run: signal.raise_signal(signal.SIGTERM)):
        run = train(config, tmp_path)
    assert read_run(run.folder).state == "finished"
    assert (run.interrupted_by, run.signal) == (None, signal.SIGTERM)


def _run(config, runs, folder):
    if folder is None:
        train(config, runs)
    else:
        resume(config, folder)


def _checkpoints(runs):
    return sorted(runs.glob("*/checkpoints/[0-9]*.pt"))


@pytest.mark.slow
@pytest.mark.parametrize(("config", "kills"), [(SAC_CONFIG, 10), (PPO_CONFIG, 3)])
def test_kills_at_random_moments_lose_nothing(config, kills, tmp_path):
    schedule = replace(SCHEDULE, total_timesteps=512, checkpoint_interval=32)
    config = replace(config, training=schedule)
    context = multiprocessing.get_context("forkserver")
    # the second is what torch's optimisers import when the first is made
    context.set_forkserver_preload(["flyrl.training.learn", "torch._dynamo"])
    whole = train(config, tmp_path / "whole")
    rng = np.random.default_rng(0)
    part, folder, last, killed = tmp_path / "part0", None, [], 0
    while killed < kills:
        process = context.Process(target=_run, args=(config, part, folder))
        process.start()
        if rng.random() < 0.5:  # some moments after another checkpoint
            while process.is_alive() and _checkpoints(part)[-1:] == last:
                time.sleep(0.01)
        process.join(rng.uniform(0.0, 1.0))
        killed += process.is_alive()
        process.kill()
        process.join()
        last = _checkpoints(part)[-1:]
        folder = last[0].parents[1] if last else None
        if folder and (folder / "status.json").exists():
            # a quick machine; the next kills are for another run
            assert _results(Run(folder, None)) == _results(whole)
            part, folder, last = tmp_path / f"part{len([*tmp_path.iterdir()])}", None, []
    resumed = resume(config, folder) if folder else train(config, part)
    assert _results(resumed) == _results(whole)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Folder of a run that was interrupted at its third decision."""
    with interrupted_at(3):
        return train(PPO_CONFIG, tmp_path_factory.mktemp("runs")).folder


@pytest.fixture
def folder(interrupted, tmp_path):
    """A copy of it."""
    return shutil.copytree(interrupted, tmp_path / "run")


def test_edited_settings_are_not_resumed(folder):
    config = replace(PPO_CONFIG, algo=PPO_CONFIG.algo.with_settings(learning_rate=0.1))
    (folder / "config.yaml").write_text(yaml.safe_dump(training_record(config)))
    with pytest.raises(ResumeError, match=r"algo\.learning_rate is .* checkpoint, not 0\.1"):
        resume(config, folder)


def test_a_setting_without_effect_may_be_edited(folder):
    config = replace(PPO_CONFIG, training=replace(PPO_CONFIG.training, num_threads=2))
    (folder / "config.yaml").write_text(yaml.safe_dump(training_record(config)))
    assert resume(config, folder).interrupted_by is None


def test_what_is_no_interrupted_run_of_these_settings_is_not_resumed(interrupted, tmp_path):
    for config, folder, message in (
        (replace(PPO_CONFIG, seed=1), interrupted, r"seed is 0 in its config\.yaml, not 1"),
        (TrainingConfig(), make_run(tmp_path / "run"), "finished"),
        (PPO_CONFIG, tmp_path, r"config\.yaml is missing"),
    ):
        with pytest.raises(ResumeError, match=message):
            resume(config, folder)


@pytest.mark.parametrize("name", ["config.yaml", "status.json", "progress.csv"])
def test_damaged_files_are_not_resumed(folder, name):
    (folder / name).write_bytes(bytes(range(256)))
    with pytest.raises(ResumeError, match=rf"cannot resume .*: {name} cannot be read"):
        resume(PPO_CONFIG, folder)


@pytest.mark.parametrize("part", ["learner", "env", "run"])
def test_a_checkpoint_that_does_not_fit_is_not_resumed(folder, part):
    path = max(folder.glob("checkpoints/*.pt"))
    state = load_checkpoint(path)
    state[part] = {"parameters": {}, "decisions": 0}
    save_checkpoint(path, state)
    with pytest.raises(ResumeError, match="does not fit the run"):
        resume(PPO_CONFIG, folder)


def test_a_run_that_another_process_trains_is_left_as_it_is(tmp_path):
    folder = make_run(tmp_path / "run", interrupted_by="SIGTERM")
    with held(folder):
        before = {path: path.read_bytes() for path in folder.iterdir()}
        with pytest.raises(RunIsHeldError):
            resume(TrainingConfig(), folder, ["train.py"])
        assert {path: path.read_bytes() for path in folder.iterdir()} == before
