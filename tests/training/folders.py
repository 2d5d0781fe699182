"""Run folders as training leaves them, without the training; and what happens during one."""

import json
import signal
import subprocess
from contextlib import contextmanager

import numpy as np
import pytest
import torch
import yaml

from flyrl.policies.bundle import save_bundle
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.callback import RunCallback
from flyrl.training.config import TrainingConfig, env_record, training_record
from tests.bundles import target_bundle

_IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@b.c")
COMMIT = "0123456789abcdef0123456789abcdef01234567"


def make_run(
    folder,
    *,
    algo="ppo",
    seed=0,
    evaluations=((100, 0.5, 1.0),),
    interrupted_by=None,
    bias=0.0,
    provenance=None,
):
    """Write a run folder; `bias` is that of its last policy, evaluations are rows of the table."""
    folder.mkdir(parents=True)
    config = TrainingConfig(algo=AlgorithmConfig(algo), seed=seed)
    (folder / "config.yaml").write_text(yaml.safe_dump(training_record(config), sort_keys=False))
    origin = {"started": folder.name, "git": {"commit": COMMIT, "is_dirty": False}}
    (folder / "provenance.json").write_text(json.dumps({**origin, **(provenance or {})}))
    lines = [f"{a},{b},{c},1.0" for a, b, c in evaluations]
    table = ["decisions,success_rate,mean_return,mean_duration_s", *lines]
    (folder / "evaluations.csv").write_text("\n".join(table) + "\n")
    status = {"decisions": 200, "wall_time_s": 12.5, "interrupted_by": interrupted_by}
    (folder / "status.json").write_text(json.dumps(status))
    bundle = target_bundle((bias, bias), env=env_record(config.env), training={"algo": algo})
    save_bundle(bundle, folder / "last.safetensors")
    return folder


@contextmanager
def before(method, act):
    """Inside the block, call `act` with a run's callback before a method of that."""
    original = getattr(RunCallback, method)

    def patched(callback):
        act(callback)
        return original(callback)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunCallback, method, patched)
        yield


def interrupted_at(decision, number=signal.SIGTERM):
    """Send a signal to this process when a run's n-th decision is reported."""
    return before("_on_step", lambda run: run.n_calls == decision and signal.raise_signal(number))


def same(a, b):
    """Whether nested states are equal to the bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, torch.Tensor | np.ndarray | np.generic):
        return type(a) is type(b) and a.dtype == b.dtype and np.array_equal(a, b)
    return a == b


def git(folder, *arguments):
    """Run git in a folder."""
    subprocess.run(["git", "-C", folder, *_IDENTITY, *arguments], check=True, capture_output=True)


def checkout(folder, contents=b"a = 1\n"):
    """Make a checkout with one commit, of a package with one module; return that."""
    package = folder / "flyrl" / "__init__.py"
    package.parent.mkdir()
    package.write_bytes(contents)
    git(folder, "init")
    git(folder, "add", package)
    git(folder, "commit", "-m", "first")
    return package
