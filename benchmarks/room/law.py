"""The law `pursuit`, tuned for a condition with as many decisions as a training has."""

from dataclasses import asdict, dataclass, replace
from typing import Final

import numpy as np

from flyrl.envs.core import BatchedEnv
from flyrl.policies.fixed import Pursuit
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.tasks import Task

STAGES: Final = ((48, 8), (12, 16), (4, 32), (2, 64))
"""Settings that are still in, and episodes that each walks: 832 in all, of up to 150 decisions
(successive halving); a training has 120,000."""


@dataclass(frozen=True)
class Settings:
    """Of `flyrl.policies.fixed.Pursuit`."""

    gain: float
    forward: float
    weakest: float
    strongest: float
    brake: float = 0.0

    def policy(self, task: Task) -> Pursuit:
        """The law with these settings."""
        return Pursuit(task, **asdict(self))


PUBLISHED: Final = Settings(1.0, 1.0, 0.2, 1.2)
QUICK: Final = Settings(2.0, 1.5, 0.0, 1.5)


def published(task: Task) -> tuple[Settings, Settings]:
    """The literature's turn and a quick one; where the fly is to stop, both brake."""
    brake = 1.5 * task.parameters["reach"] if task.name == "stop" else 0.0
    return replace(PUBLISHED, brake=brake), replace(QUICK, brake=brake)


def draw_settings(rng: np.random.Generator, task: Task) -> Settings:
    """Draw settings: the gain log-uniformly, the drives and, to stop, the brake uniformly."""
    return Settings(
        gain=float(np.exp(rng.uniform(np.log(0.3), np.log(4.0)))),
        forward=float(rng.uniform(0.4, 1.5)),
        weakest=float(rng.uniform(-0.5, 0.6)),
        strongest=float(rng.uniform(0.8, 1.5)),
        brake=float(rng.uniform(0.5, 4.0)) if task.name == "stop" else 0.0,
    )


def score(records: list[EpisodeRecord]) -> float:
    """Share of successes; among equal ones the quicker law is better."""
    worth = [
        each.success - 0.1 * (each.duration_s if each.success else each.horizon_s) / each.horizon_s
        for each in records
    ]
    return float(np.mean(worth))


def tuned(env: BatchedEnv, seed: int = 0) -> Settings:
    """Best settings on training episodes, whose seeds are below 2**31."""
    rng = np.random.default_rng(seed)
    left = [*published(env.task), *(draw_settings(rng, env.task) for _ in range(STAGES[0][0] - 2))]
    for count, episodes in STAGES:
        drawn = [
            env.config.sample_episode(int(each)) for each in rng.integers(2**31, size=episodes)
        ]
        scores = [
            score(run_episodes(env, settings.policy(env.task), drawn)) for settings in left[:count]
        ]
        left = [left[i] for i in np.argsort(-np.array(scores), kind="stable")]
    return left[0]
