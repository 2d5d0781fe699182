"""A run of a few updates, and one that crashes on the way."""

from dataclasses import replace

import pytest

from flyrl.training.callback import RunCallback
from flyrl.training.learn import resume, train
from flyrl.training.runs import read_rows
from tests import tiny

DECISIONS = "time/total_timesteps"
UPDATES = [32, 64, 96, 128]
TINY = replace(
    tiny.TINY,
    training=replace(
        tiny.TINY.training,
        total_timesteps=128,
        evaluation_interval=64,
        evaluation_episodes=1,
        checkpoint_interval=64,
    ),
)


def logged(folder):
    """What progress.csv holds: (step, key, value), in order of step and key.

    The last row has the step of the one before; some keys are in both.
    """
    points, step = [], 0
    for row in read_rows(folder / "progress.csv"):
        step = int(row[DECISIONS] or step)
        points += [(step, key, float(text)) for key, text in row.items() if text]
    return sorted(points, key=lambda point: point[:2])


def crash_and_resume(logger, runs, monkeypatch):
    """Train with a crash after 120 decisions, logged up to 96, then from the checkpoint at 64."""
    config = replace(TINY, logger=logger)
    report = RunCallback._on_step

    def on_step(callback):
        if callback.num_timesteps == 120:
            raise RuntimeError("the crash")
        return report(callback)

    with monkeypatch.context() as patch:
        patch.setattr(RunCallback, "_on_step", on_step)
        with pytest.raises(RuntimeError, match="the crash"):
            train(config, runs)
    (folder,) = runs.iterdir()
    yield folder
    yield resume(config, folder).folder
