import multiprocessing
import os
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
from flyrl.training.callback import RunCallback
from flyrl.training.config import CurriculumConfig, TrainingConfig, training_record
from flyrl.training.learn import Run, resume, train
from flyrl.training.run_folder import load_checkpoint, save_checkpoint
from flyrl.training.runs import ResumeError, RunIsHeldError, held, read_rows, read_run
from tests.tiny import TINY, TINY_ENV
from tests.training.folders import make_run

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


class InterruptedAt:
    """Sends a signal to this process when a run's n-th decision is reported."""

    def __init__(self, monkeypatch, decision, number=signal.SIGTERM):
        report = RunCallback._on_step

        def on_step(callback):
            if callback.n_calls == decision:
                os.kill(os.getpid(), number)
            return report(callback)

        monkeypatch.setattr(RunCallback, "_on_step", on_step)


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
    with pytest.MonkeyPatch.context() as patch:
        InterruptedAt(patch, decision=27)
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


def test_a_run_that_is_interrupted_in_its_last_rollout_is_resumed(tmp_path, monkeypatch):
    # the last rollout goes beyond the total
    schedule = replace(SCHEDULE, total_timesteps=90, checkpoint_interval=10_000)
    config = replace(PPO_CONFIG, training=schedule)
    whole = train(config, tmp_path / "whole")
    with monkeypatch.context() as patch:
        InterruptedAt(patch, decision=22)
        part = train(config, tmp_path / "part")
    assert read_run(part.folder).state == "interrupted"
    assert _results(resume(config, part.folder)) == _results(whole)


def test_a_signal_during_the_last_evaluation_is_too_late(tmp_path, monkeypatch):
    evaluate = RunCallback._evaluate

    def interrupted(callback):
        os.kill(os.getpid(), signal.SIGTERM)
        return evaluate(callback)

    monkeypatch.setattr(RunCallback, "_evaluate", interrupted)
    config = replace(PPO_CONFIG, training=replace(SCHEDULE, total_timesteps=32))
    run = train(config, tmp_path)
    assert read_run(run.folder).state == "finished"
    assert (run.interrupted_by, run.signal) == (None, signal.SIGTERM)


def _run(config, runs, folder):
    if folder is None:
        train(config, runs)
    else:
        resume(config, folder)


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
    part, folder, last, longest_wait = tmp_path / "part0", None, [], 1.0
    killed = stages = 0
    # on a slow machine, it takes some kills until one comes after the first checkpoint
    while killed < kills or stages < 3:
        process = context.Process(target=_run, args=(config, part, folder))
        process.start()
        time.sleep(rng.uniform(0.0, longest_wait))
        if process.is_alive():
            process.kill()
            killed += 1
        process.join()
        checkpoints = sorted(part.glob("*/checkpoints/[0-9]*.pt"))
        folder = checkpoints[-1].parents[1] if checkpoints else None
        if checkpoints[-1:] == last:
            longest_wait *= 1.5  # nothing was learned before the kill: a slow machine
        else:
            last, stages = checkpoints[-1:], stages + 1
        if folder and (folder / "status.json").exists():
            # a quick machine; the next kills are for another run
            assert _results(Run(folder, None)) == _results(whole)
            part, folder, longest_wait = tmp_path / f"part{killed}", None, longest_wait / 4
    resumed = resume(config, folder) if folder else train(config, part)
    assert _results(resumed) == _results(whole)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Folder of a run that was interrupted at its third decision."""
    with pytest.MonkeyPatch.context() as patch:
        InterruptedAt(patch, decision=3)
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
        (PPO_CONFIG, tmp_path, "not the folder of a run"),
    ):
        with pytest.raises(ResumeError, match=message):
            resume(config, folder)


@pytest.mark.parametrize(
    ("name", "contents", "message"),
    [
        *[
            ("config.yaml", text, r"config\.yaml")
            for text in ("", "a word", "- a", "task: 1", "a: &a [1]\nb: [*a]", "\x00")
        ],
        *[
            ("status.json", text, r"status\.json cannot be read")
            for text in ("{", "[]", "{}", "[" * 10**5)
        ],
        ("progress.csv", "".join(map(chr, range(256))), r"progress\.csv is no table"),
    ],
)
def test_damaged_files_are_not_resumed(folder, name, contents, message):
    (folder / name).write_bytes(contents.encode("latin-1"))
    with pytest.raises(ResumeError, match=message):
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
