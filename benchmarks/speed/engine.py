"""Physics steps per second of walking flies, controller included, and of worms."""

import time
from collections.abc import Sequence
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.speed.results import Row, significant
from flyrl.bodies.worm import WORMS
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.flies import FlyBatch
from flyrl.simulation.scene import Scene, SceneConfig, build_scene
from flyrl.simulation.worms import WormBatch
from flyrl.tasks import Episode

SETTLING_S: Final = 0.2
"""s of simulated time before anything is measured: the fly drops and gets going."""

WINDOW_S: Final = 0.3
"""s of simulated time that are measured at once; then the flies are put back to their start, before
they walk off the terrain."""

MAX_SETTLED: Final = 64
"""Flies that are settled, at most; a larger batch repeats them."""

BLOCK: Final = 50
"""Steps at a time, of which a window is a whole number in every preset."""

WORM_DECISION_S: Final = 0.05
"""s of simulated time for which muscles hold."""

WORM_WARM_UP: Final = 10
"""Decisions before anything is measured: the worms get going."""

States = NDArray[np.float64]


def settle(env: BatchedEnv) -> States:
    """States of the flies of seeds 0, 1, 2, … that have walked straight for `SETTLING_S`."""
    env.reset(seeds=list(range(env.num_envs)))
    env.flies.set_command(np.ones((env.num_envs, 2)))
    env.flies.step(round(SETTLING_S / env.config.scene.physics.timestep))
    return env.flies.integration_state()


def settled_scene(
    physics: str, terrain: str, flies: int, most: int = MAX_SETTLED
) -> tuple[Scene, States]:
    """Scene of one row of the table, and `flies` states in it to start from.

    Only the first `most` are settled; the others repeat them.
    """
    config = EnvConfig(task="hybrid_turning", physics=physics, terrain=terrain)
    env = BatchedEnv(config, min(flies, most))
    states = settle(env)
    return env.flies.scene, np.resize(states, (flies, states.shape[1]))


def steps_per_second(flies: FlyBatch, start: States, seconds: float) -> float:
    """Physics steps of all flies together per second of wall time.

    Parameters
    ----------
    flies
        To be stepped.
    start
        States that a window of walking begins with.
    seconds
        Wall time to spend, s.
    """
    per_window = round(WINDOW_S / flies.scene.config.physics.timestep)
    taken, steps = 0.0, 0
    while taken < seconds:
        if steps % per_window == 0:
            flies.restore(start)
        taken += _time(flies, BLOCK)
        steps += BLOCK
    return flies.num_sims * steps / taken


def measure(
    presets: Sequence[str],
    terrains: Sequence[str],
    threads: Sequence[int],
    batches: Sequence[int],
    seconds: float,
) -> list[Row]:
    """One row per preset, terrain, number of threads and number of flies."""
    rows = []
    for physics, terrain in tqdm(list(product(presets, terrains)), desc="engine"):
        scene, start = settled_scene(physics, terrain, max(batches))
        for num_threads, num_flies in product(threads, batches):
            flies = FlyBatch(scene, num_flies, num_threads)
            speed = steps_per_second(flies, start[:num_flies], seconds)
            rows.append(
                {
                    "physics": physics,
                    "terrain": terrain,
                    "threads": num_threads,
                    "flies": num_flies,
                    "steps_per_s": significant(speed),
                    "real_time": significant(speed * scene.config.physics.timestep),
                    "unstable": int(flies.state().is_unstable.sum()),
                }
            )
    return rows


def walking_time(flies: FlyBatch, start: States, steps: int) -> float:
    """Wall time of some steps of all flies, from the start on, s."""
    flies.restore(start)
    return _time(flies, steps)


def _time(bodies: FlyBatch | WormBatch, steps: int) -> float:
    began = time.perf_counter()
    bodies.step(steps)
    return time.perf_counter() - began


def measure_worms(seconds: float, worms: int = 32) -> list[Row]:
    """One row per named worm: on one thread, all muscles recruited anew every `WORM_DECISION_S`.

    Parameters
    ----------
    seconds
        Wall time to spend on each, s.
    worms
        Number that are stepped together.
    """
    rows = []
    for name in tqdm(WORMS, desc="worm"):
        batch = WormBatch(build_scene(SceneConfig(WORMS[name])), worms, num_threads=1)
        batch.start(np.arange(worms), [Episode(0, (0.0, 0.0, 0.0), 0.0, ())] * worms)
        pools = [len(attached.muscle.pool) for attached in batch.scene.muscles]
        steps = round(WORM_DECISION_S / batch.scene.model.opt.timestep)
        rng = np.random.default_rng(0)
        taken, decisions = 0.0, -WORM_WARM_UP
        while decisions < 1 or taken < seconds:
            batch.set_command(rng.integers(0, pools, (worms, len(pools))))
            spent = _time(batch, steps)
            if decisions >= 0:
                taken += spent
            decisions += 1
        speed = worms * steps * decisions / taken
        rows.append(
            {
                "worm": name,
                "worms": worms,
                "steps_per_s": significant(speed),
                "real_time": significant(speed * batch.scene.model.opt.timestep),
                "unstable": int(batch.state().is_unstable.sum()),
            }
        )
    return rows
