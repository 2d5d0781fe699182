"""Physics steps per second of worms whose muscles are recruited at random."""

import time
from typing import Final

import numpy as np
from tqdm import tqdm

from flyrl.bench.results import Row, significant
from flyrl.bodies.worm import WORMS
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.simulation.worms import WormBatch

DECISION_S: Final = 0.05
"""s of simulated time for which muscles hold."""

WARM_UP: Final = 10
"""Decisions before anything is measured: the worms get going."""


def measure(seconds: float, worms: int = 32) -> list[Row]:
    """One row per named worm: on one thread, all muscles recruited anew every `DECISION_S`.

    Parameters
    ----------
    seconds
        Wall time to spend on each, s.
    worms
        How many are stepped together.
    """
    return [_measure(name, seconds, worms) for name in tqdm(WORMS, desc="worm")]


def _measure(name: str, seconds: float, worms: int) -> Row:
    body = WORMS[name]
    batch = WormBatch(build_scene(SceneConfig(body)), worms, num_threads=1)
    batch.reset(
        np.arange(worms), np.zeros((worms, 2)), np.zeros(worms), np.zeros((worms, body.joints))
    )
    pools = [len(attached.muscle.pool) for attached in batch.scene.muscles]
    steps = round(DECISION_S / batch.scene.model.opt.timestep)
    rng = np.random.default_rng(0)
    taken, decisions = 0.0, -WARM_UP
    while decisions < 1 or taken < seconds:
        batch.set_command(rng.integers(0, pools, (worms, len(pools))))
        began = time.perf_counter()
        batch.step(steps)
        if decisions >= 0:
            taken += time.perf_counter() - began
        decisions += 1
    speed = worms * steps * decisions / taken
    return {
        "worm": name,
        "worms": worms,
        "steps_per_s": significant(speed),
        "real_time": significant(speed * batch.scene.model.opt.timestep),
        "unstable": int(batch.state().is_unstable.sum()),
    }
