"""Where the time goes above the engine: the vector environment, PPO, and the single environment.

Methods are timed by wrapping them here, from outside; flyrl itself carries no clock.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any

import gymnasium
import numpy as np
import torch
from tqdm import tqdm

import flyrl  # noqa: F401 (registers the environments)
from benchmarks.speed.results import Row, significant
from flyrl.envs.core import EnvConfig
from flyrl.envs.sb3 import FlyrlVecEnv
from flyrl.training.config import TrainingConfig
from flyrl.training.models import build_model


class Stopwatch:
    """Adds up wall time by name; what runs inside another name's time counts for itself alone.

    Parameters
    ----------
    clock
        Gives the time, s.

    Attributes
    ----------
    seconds
        Time so far, by name.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._clock = clock
        self._running: list[str] = []
        self._since = 0.0

    @contextmanager
    def timing(self, name: str) -> Iterator[None]:
        """Count the block as `name`."""
        self._credit()
        self._running.append(name)
        try:
            yield
        finally:
            self._credit()
            self._running.pop()

    def wrap(self, owner: Any, method: str, name: str) -> None:
        """Count every call of `owner.method` from now on as `name`."""
        wrapped = getattr(owner, method)

        @wraps(wrapped)
        def timed(*args: Any, **kwargs: Any) -> Any:
            with self.timing(name):
                return wrapped(*args, **kwargs)

        setattr(owner, method, timed)

    def shares(self) -> dict[str, float]:
        """Share of each name in the time of all."""
        total = sum(self.seconds.values())
        return {name: seconds / total for name, seconds in self.seconds.items()}

    def _credit(self) -> None:
        now = self._clock()
        if self._running:
            self.seconds[self._running[-1]] += now - self._since
        self._since = now


def measure_environment(threads: Sequence[int], decisions: int = 150, flies: int = 64) -> list[Row]:
    """Shares of the engine, of resets and of the rest in `FlyrlVecEnv.step`, per number of threads.

    Task `target`, balanced physics, flat ground, random actions; an episode has up to 150
    decisions, at whose end resets come.
    """
    rows = []
    for num_threads in threads:
        env = FlyrlVecEnv(EnvConfig(), flies, num_threads, seed=0)
        rng = np.random.default_rng(0)
        env.reset()
        watch = Stopwatch()
        watch.wrap(env, "step", "rest")
        watch.wrap(env.core, "reset", "resets")
        watch.wrap(env.core.flies, "step", "engine")
        for _ in tqdm(range(decisions), desc=f"environment, threads: {num_threads}"):
            env.step(rng.uniform(-1.0, 1.0, (flies, 2)).astype(np.float32))
        rows.append(
            {
                "threads": num_threads,
                "flies": flies,
                "ms_per_step": significant(1e3 * sum(watch.seconds.values()) / decisions),
                **_shares(watch, ("engine", "resets", "rest")),
            }
        )
    return rows


def measure_ppo() -> list[Row]:
    """Shares of physics, environment, policy and update in some rollouts of the default training.

    "collection" is the share of physics in what is not update: the rate at which decisions are
    collected, over the engine's own. The default is 32 flies. One rollout and its update go before,
    to warm up.
    """
    return [_measure_ppo(flies) for flies in (32, 64)]


def _measure_ppo(flies: int, rollouts: int = 3) -> Row:
    config = TrainingConfig()
    if config.algo.name != "ppo":
        raise TypeError(f"the default algorithm is {config.algo.name}, not PPO")
    torch.set_num_threads(config.training.torch_threads)
    env = FlyrlVecEnv(config.env, flies, config.training.num_threads)
    env.seed(config.seed)
    model = build_model(config.algo, env, config.seed)
    decisions = config.algo.settings["n_steps"] * flies
    with tqdm(total=rollouts + 1, desc=f"ppo, flies: {flies}") as bar:
        model.learn(decisions)
        bar.update()
        watch = Stopwatch()
        watch.wrap(env.core.flies, "step", "physics")
        for method in ("reset", "step"):
            watch.wrap(env, method, "environment")
        for method in ("forward", "predict_values"):
            watch.wrap(model.policy, method, "policy")
        watch.wrap(model, "train", "update")
        with watch.timing("rest"):
            model.learn(rollouts * decisions)
        bar.update(rollouts)
    shares = _shares(watch, ("physics", "environment", "policy", "update", "rest"))
    return {
        "flies": flies,
        "decisions": rollouts * decisions,
        "decisions_per_s": significant(rollouts * decisions / sum(watch.seconds.values())),
        **shares,
        "collection": significant(shares["physics"] / (1.0 - shares["update"])),
    }


def measure_single(presets: Sequence[str], steps: int = 5_000, warm_up: int = 500) -> list[Row]:
    """Physics steps per second of `flyrl/HybridTurning-v0`, one per call from Python."""
    rows = []
    action = np.ones(2, dtype=np.float32)
    for physics in tqdm(presets, desc="single"):
        env = gymnasium.make("flyrl/HybridTurning-v0", physics=physics)
        env.reset(seed=0)
        for _ in range(warm_up):
            env.step(action)
        began = time.perf_counter()
        for _ in range(steps):
            env.step(action)
        rows.append(
            {
                "physics": physics,
                "steps": steps,
                "steps_per_s": significant(steps / (time.perf_counter() - began)),
            }
        )
        env.close()
    return rows


def _shares(watch: Stopwatch, names: Sequence[str]) -> dict[str, float]:
    shares = watch.shares()
    return {name: significant(shares.get(name, 0.0)) for name in names}
