"""Speed of the engine: the full controller against bare MuJoCo on the same trajectory.

Run `python benchmarks/engine.py` on an idle machine. Both columns step the same model through
the same trajectory on one thread; the bare one replays the recorded controls without any
callback. Ratios come from alternating runs, so that a drift of the machine's speed cancels.
"""

import argparse
import time

import mujoco
import numpy as np
from mujoco.batch import Batch

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation import callback


def measure(physics: str, terrain: str, flies: int, seconds: float, repeats: int) -> None:
    """Print physics steps per second with the controller and without, on one thread."""
    env = BatchedEnv(
        EnvConfig(task="hybrid_turning", physics=physics, terrain=terrain), flies, num_threads=1
    )
    timestep = env.config.scene.physics.timestep
    env.reset(seeds=list(range(flies)))
    env.flies.set_drive(np.ones((flies, 2)))
    env.flies.step(round(0.2 / timestep))
    start = env.flies.integration_state()
    num_steps = round(seconds / timestep)
    controls = np.empty((flies, num_steps, env.scene.model.nu))
    recorder = env.flies.controllers
    for step in range(num_steps):
        env.flies.step(1)
        controls[:, step, :42] = recorder["targets"]
        controls[:, step, 42:] = recorder["adhesion"]
    end = env.flies.state().position_w

    bare = Batch(env.scene.model, flies, 1)
    full_times, bare_times = [], []
    for _ in range(repeats):
        env.flies.restore(start)
        began = time.perf_counter()
        env.flies.step(num_steps)
        full_times.append(time.perf_counter() - began)
        mujoco.set_mjcb_control(None)
        mujoco.set_mjcb_sensor(None)
        bare.state[:] = start
        began = time.perf_counter()
        bare.rollout(num_steps, controls)
        bare_times.append(time.perf_counter() - began)
        callback.install()
    if not np.allclose(env.flies.state().position_w, end, atol=1e-6):
        raise RuntimeError("the timed run left the recorded trajectory")
    if not np.allclose(bare.bind("qpos")[:, :3], end, atol=1e-6):
        raise RuntimeError("the bare replay left the recorded trajectory")
    total = flies * num_steps
    full, base = total / np.median(full_times), total / np.median(bare_times)
    ratio = np.median(np.array(bare_times) / np.array(full_times))
    print(
        f"{physics:10} {terrain:7} {timestep:g} s  with controller {full:8,.0f} steps/s = "
        f"{full * timestep:5.2f} x real time, bare {base:8,.0f} steps/s, ratio {ratio:.3f}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flies", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=0.3)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--physics", nargs="+", default=["reference", "balanced"])
    parser.add_argument("--terrain", nargs="+", default=["flat", "gapped", "blocks", "mixed"])
    given = parser.parse_args()
    for physics in given.physics:
        for terrain in given.terrain:
            measure(physics, terrain, given.flies, given.seconds, given.repeats)
