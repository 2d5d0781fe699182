"""Random drives on all terrains: how episodes end, and whether the physics ever blows up."""

from collections import Counter

import mujoco
import numpy as np
from tqdm import tqdm

from benchmarks.fidelity.drives import ABRUPT_S, HIGH, LOW
from benchmarks.fidelity.flyrl_runs import drive
from flyrl.envs.core import BatchedEnv, EnvConfig


def outcomes(
    physics: str, terrain: str, episodes: int, seconds: float, threads: int = 0
) -> tuple[Counter[str], Counter[str]]:
    """Drive flies at random, uniformly over the drive's range, until they fall or time is up.

    Returns
    -------
    How many episodes ended how, and how often MuJoCo warned of what.
    """
    config = EnvConfig(
        task="hybrid_turning", physics=physics, terrain=terrain, decision_interval=ABRUPT_S
    )
    ended: Counter[str] = Counter()
    warned: Counter[str] = Counter()
    for first in tqdm(range(0, episodes, 100), desc=f"{physics} {terrain}", unit="100 episodes"):
        seeds = range(first, min(first + 100, episodes))
        env = BatchedEnv(config, len(seeds), threads)
        shape = (round(seconds / ABRUPT_S), len(seeds), 2)
        actions = np.random.default_rng(first).uniform(LOW, HIGH, shape)
        _, _, how = drive(env, seeds, actions.__getitem__, len(actions), magnitude=None)
        ended.update(how.tolist())
        for kind, number in enumerate(env.flies.warnings().sum(axis=0)):
            if number:
                name = mujoco.mjtWarning(kind).name.removeprefix("mjWARN_").lower()
                warned[name] += int(number)
    return ended, warned
