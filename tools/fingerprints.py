"""Hashes of simulations, of a training and of an evaluation: what a refactoring must leave alone.

    python tools/fingerprints.py before.json            # at the revision before
    python tools/fingerprints.py --compare before.json  # after; fails where a hash differs

Bits depend on the machine and its packages, so the two are run on one machine.
"""

import argparse
import hashlib
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from tqdm import tqdm

ROOT: Final = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import flyrl  # noqa: E402, F401 - registers the environments
from flyrl.envs.core import BatchedEnv, EnvConfig  # noqa: E402
from flyrl.tasks import Neurons  # noqa: E402

PRESETS: Final = ("reference", "balanced", "fast")
TERRAINS: Final = ("flat", "gapped", "blocks", "mixed")
CONTROLLERS: Final = ("cpg", "rule_based", "hybrid")
DECISION_S: Final = 0.02
DECISIONS: Final = 15
BATCH: Final = 3

WORM_TASKS: Final = ("worm_crawl", "worm_crawl_box", "worm_hang", "worm_hang_box")
WORM_DECISIONS: Final = 20

STATE: Final = (
    "position_w", "velocity_w", "rotation_w", "joint_angles", "joint_velocities",
    "actuator_torques", "contact_forces_w", "end_effectors_w",
)  # fmt: skip
"""Fields of the state that are hashed, in double precision."""

TRAINING: Final = (
    "physics=fast", "terrain=blocks", "task.time_limit=0.2", "video_after=false",
    "training.total_timesteps=512", "training.num_envs=4", "training.evaluation_interval=256",
    "training.evaluation_episodes=2", "training.checkpoint_interval=64",
    "training.progress_bar=false", "algo.n_steps=8", "algo.batch_size=16", "algo.n_epochs=2",
    "algo.hidden_layers=[8]",
)  # fmt: skip
EVALUATION: Final = (
    "terrains=[flat,mixed]", "episodes=4", "policies=[target-flat]", "videos=false",
    "close_ups=false", "progress_bar=false",
)  # fmt: skip


def main() -> None:
    """Write the fingerprints to a file, or compare them with those in one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--compare", action="store_true", help="with those in the file")
    parser.add_argument("--simulations", action="store_true", help="no training, no evaluation")
    chosen = parser.parse_args()
    found = dict(_simulations()) | dict(_worms())
    if not chosen.simulations:
        with tempfile.TemporaryDirectory() as folder:
            found |= dict(_training(Path(folder)))
            found["evaluation"] = _evaluation(Path(folder))
    if not chosen.compare:
        chosen.file.write_text(json.dumps(found, indent=1) + "\n")
        return
    before = json.loads(chosen.file.read_text())
    changed = [name for name in found if found[name] != before.get(name)]
    print(f"{len(found) - len(changed)} of {len(found)} are equal", *changed, sep="\n")
    sys.exit(bool(changed))


def _simulations() -> Iterator[tuple[str, str]]:
    """Hash of what flies do under random drives, one alone and several in a batch."""
    cells = [(p, t, c) for p in PRESETS for t in TERRAINS for c in CONTROLLERS]
    for physics, terrain, controller in tqdm(cells, unit="scene"):
        config: dict[str, Any] = {
            "physics": physics,
            "terrain": terrain,
            "controller": controller,
            "decision_interval": DECISION_S,
        }
        env_id = "flyrl/HybridTurning-v0"
        name = f"{physics} {terrain} {controller}"
        single = gymnasium.make(env_id, disable_env_checker=True, **config)
        yield f"{name}, single", _walk(single, ())
        batch = gymnasium.make_vec(env_id, num_envs=BATCH, **config)
        yield f"{name}, batch", _walk(batch, (BATCH,))


def _walk(env: Any, shape: tuple[int, ...]) -> str:
    rng = np.random.default_rng(1)
    env.reset(seed=7)
    digest = hashlib.sha256()
    for _ in range(DECISIONS):
        env.step(rng.uniform(-0.5, 1.5, size=(*shape, 2)).astype(np.float32))
        state = env.unwrapped.core.state
        assert {item.name for item in fields(state)} >= set(STATE)
        for field in STATE:
            digest.update(np.ascontiguousarray(getattr(state, field)).tobytes())
    env.close()
    return digest.hexdigest()


def _worms() -> Iterator[tuple[str, str]]:
    """Hash of what worms do under random actions, reset, snapshotted and restored in the midst."""
    for task in WORM_TASKS:
        env = BatchedEnv(EnvConfig(task), BATCH, num_threads=2)
        rng = np.random.default_rng(1)
        digest = hashlib.sha256(np.asarray(env.reset(seeds=[*range(BATCH)])).tobytes())
        for decision in range(WORM_DECISIONS):
            if decision == WORM_DECISIONS // 4:
                digest.update(np.asarray(env.reset(ids=[1])).tobytes())
            if decision == WORM_DECISIONS // 2:
                snapshot = env.snapshot()
                env = BatchedEnv(EnvConfig(task), BATCH, num_threads=1)
                env.restore(snapshot)
            neurons = env.task.actions
            assert isinstance(neurons, Neurons)
            low, high = neurons.bounds
            actions = rng.uniform(low, high, size=(BATCH, neurons.size))
            if neurons.is_integer:
                actions = rng.integers(0, neurons.pools, size=actions.shape).astype(np.float64)
            transition = env.step(actions)
            for values in (transition.observation, transition.reward):
                digest.update(np.ascontiguousarray(values).tobytes())
            digest.update(env.batch.integration_state().tobytes())
        yield task, digest.hexdigest()


def _training(folder: Path) -> Iterator[tuple[str, str]]:
    """Hash of the policy of a whole training, and of one that was interrupted and resumed."""
    _run("train.py", *TRAINING, f"runs_folder={folder / 'whole'}")
    yield "training", _policy(folder / "whole")
    part = folder / "part"
    command = [sys.executable, str(ROOT / "train.py"), *TRAINING, f"runs_folder={part}"]
    with subprocess.Popen(command) as process:
        while process.poll() is None and not any(part.glob("*/checkpoints/[!.]*.pt")):
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
    (run,) = part.iterdir()
    if process.returncode == 0:
        raise RuntimeError("the training ended before it was interrupted")
    _run("train.py", f"resume={run}", "video_after=false")
    yield "training, resumed", _policy(part)


def _policy(runs: Path) -> str:
    """Hash of the parameters of the last policy, without what its file says of the run."""
    from safetensors.numpy import load_file  # noqa: PLC0415

    (path,) = runs.glob("*/last.safetensors")
    digest = hashlib.sha256()
    for name, values in sorted(load_file(path).items()):
        digest.update(name.encode() + values.tobytes())
    return digest.hexdigest()


def _evaluation(folder: Path) -> str:
    _run("evaluate.py", *EVALUATION, f"folder={folder / 'report'}")
    return hashlib.sha256((folder / "report" / "episodes.csv").read_bytes()).hexdigest()


def _run(program: str, *arguments: str) -> None:
    subprocess.run([sys.executable, str(ROOT / program), *arguments], check=True)


if __name__ == "__main__":
    main()
