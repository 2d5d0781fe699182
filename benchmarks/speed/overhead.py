"""What controller and environment cost, beside bare MuJoCo on the same trajectory.

Bare MuJoCo replays the recorded controls without any callback. Ratios are medians over repeats
that take turns, so that a drift of the machine's speed cancels.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.speed.engine import States, settle
from benchmarks.speed.results import Row, significant
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation import callback
from flyrl.simulation.scene import Scene

SAME: Final = 1e-6
"""The same bits go in, so the same must come out; mm, rad."""


@dataclass(frozen=True)
class Recording:
    """A stretch of walking: where it starts, the controls of each step, and where it ends.

    Attributes
    ----------
    start
        Integration states, (n, size).
    controls
        (n, steps, 48).
    end
        Position of the thorax and angles of the 42 joints, (n, 45).
    """

    start: States
    controls: NDArray[np.float64]
    end: NDArray[np.float64]


def measure(
    presets: Sequence[str],
    terrains: Sequence[str],
    seconds: float = 0.2,
    repeats: int = 5,
    flies: int = 16,
) -> list[Row]:
    """One row per preset and terrain, on one thread; `seconds` of simulated time per repeat."""
    rows = []
    for physics, terrain in tqdm(list(product(presets, terrains)), desc="overhead"):
        env = BatchedEnv(EnvConfig("target", physics=physics, terrain=terrain), flies, 1)
        about = {"physics": physics, "terrain": terrain, "flies": flies}
        rows.append({**about, **_ratios(env, seconds, repeats)})
    return rows


def _ratios(env: BatchedEnv, seconds: float, repeats: int) -> Row:
    per_decision = env.config.steps_per_decision
    decisions = max(1, round(seconds / env.config.decision_interval_s))
    num_steps = decisions * per_decision
    action = env.task.actions.of(np.ones((env.num_envs, 2)))
    recording = record(env, env.task.actions.commands(action), num_steps)
    bare = Batch(env.batch.scene.model, env.num_envs, 1)

    def decide() -> None:
        for _ in range(decisions):
            env.step(action)

    times: dict[str, list[float]] = {"bare": [], "controller": [], "environment": []}
    for _ in range(repeats):
        times["bare"].append(replay(bare, env.flies.scene, recording))
        times["controller"].append(_timed(env, recording, lambda: env.flies.step(num_steps)))
        times["environment"].append(_timed(env, recording, decide))
    base = np.array(times["bare"])
    row = {}
    for name, taken in times.items():
        row[name] = significant(env.num_envs * num_steps / float(np.median(taken)))
        row[f"{name}_ratio"] = significant(float(np.median(base / np.array(taken))))
    return row


def record(env: BatchedEnv, drive: NDArray[np.float64], num_steps: int) -> Recording:
    """Walk once, step by step, and keep the controls."""
    flies = env.flies
    settle(env)
    flies.set_command(drive)
    start = flies.integration_state()
    controls = np.empty((env.num_envs, num_steps, env.batch.scene.model.nu))
    servos = flies.output["angles"].shape[1]
    for step in range(num_steps):
        flies.step(1)
        controls[:, step, :servos] = flies.output["angles"]
        controls[:, step, servos:] = flies.output["adhesion"]
    return Recording(start, controls, _pose(env))


def replay(bare: Batch, scene: Scene, recording: Recording) -> float:
    """Wall time of bare MuJoCo for the recording, s.

    Raises
    ------
    RuntimeError
        If it ends elsewhere.
    """
    bare.state[:] = recording.start
    mujoco.set_mjcb_control(None)
    mujoco.set_mjcb_sensor(None)
    try:
        began = time.perf_counter()
        bare.rollout(recording.controls.shape[1], recording.controls, record=())
        taken = time.perf_counter() - began
    finally:
        callback.install()
    qpos = bare.bind("qpos")
    end = np.concatenate([qpos[:, :3], qpos[:, scene.joint_qpos]], axis=1)
    _check(end, recording, "the bare replay")
    return taken


def _timed(env: BatchedEnv, recording: Recording, run: Callable[[], None]) -> float:
    env.flies.restore(recording.start)
    env.state = env.flies.state()
    began = time.perf_counter()
    run()
    taken = time.perf_counter() - began
    _check(_pose(env), recording, "the timed run")
    return taken


def _pose(env: BatchedEnv) -> NDArray[np.float64]:
    state = env.flies.state()
    return np.concatenate([state.position_w, state.joint_angles], axis=1)


def _check(found: NDArray[np.float64], recording: Recording, what: str) -> None:
    if not np.allclose(found, recording.end, rtol=0, atol=SAME):
        raise RuntimeError(f"{what} left the recorded trajectory")
