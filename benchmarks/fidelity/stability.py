"""Random drives on all terrains: how episodes end, and whether the physics ever blows up."""

from collections import Counter

import mujoco
import numpy as np
from tqdm import tqdm

from benchmarks.fidelity.drives import ABRUPT_S, HIGH, LOW
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
    env = BatchedEnv(config, min(episodes, 100), threads)
    ended: Counter[str] = Counter()
    warned: Counter[str] = Counter()
    with tqdm(total=episodes, desc=f"{physics} {terrain}", unit="episode") as progress:
        for first in range(0, episodes, env.num_envs):
            count = min(env.num_envs, episodes - first)
            rng = np.random.default_rng(first)
            env.reset(seeds=list(range(first, first + env.num_envs)))
            going = np.arange(count)
            for _ in range(round(seconds / ABRUPT_S)):
                action = rng.uniform(LOW, HIGH, size=(env.num_envs, 2))
                transition = env.step(action, ids=going)
                ends = transition.terminated[going]
                ended.update(transition.outcome[going[ends]].tolist())
                going = going[~ends]
                if not len(going):
                    break
            ended["timeout"] += len(going)
            numbers = env.flies.warnings()[:count].sum(axis=0)
            for kind in range(int(mujoco.mjtWarning.mjNWARNING)):
                if numbers[kind]:
                    name = mujoco.mjtWarning(kind).name.removeprefix("mjWARN_").lower()
                    warned[name] += int(numbers[kind])
            progress.update(count)
    return ended, warned
