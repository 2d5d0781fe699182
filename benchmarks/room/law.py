"""A law, tuned for a condition on training episodes."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from flyrl.envs.core import BatchedEnv
from flyrl.policies.fixed import ClosedLoop, FixedPolicy, Pursuit
from flyrl.policies.laws import (
    FIXED,
    QUICK_PURSUIT,
    UnhurriedPursuit,
    pursuit_brake,
    unhurried_settings,
)
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.tasks import Task

GENTLE: Final = {"gain": 1.0, "forward": 0.6, "weakest": 0.2, "strongest": 0.9}
"""Slow enough to hold on to a steep slope: at 60° 12 of 64 flies reach their target, and with the
literature's turn none of 20."""

NUM_LAWS: Final = 24
"""Laws that are tuned, unless asked otherwise: over 416 episodes of up to 150 decisions."""

Settings = Mapping[str, float]
"""Of the law, by name."""


def law(task: Task, settings: Settings) -> FixedPolicy:
    """The law that steers in a task: `pursuit`, or `closed_loop` where there is a command.

    With a `reserve`, it is `unhurried`.
    """
    if _is_commanded(task):
        return ClosedLoop(task, **settings)
    return (UnhurriedPursuit if "reserve" in settings else Pursuit)(task, **settings)


def _is_commanded(task: Task) -> bool:
    return "command" in task.slices()


def known(task: Task) -> dict[str, Settings]:
    """Laws that tuning begins with, by name: the published one first, then flyrl's usual one.

    Of a pursuit the literature's turn, the quick, the gentle, and, where the time left is shown,
    `unhurried`; where the fly is to stop, all brake. Of a command: answered without a correction,
    and with the usual one.
    """
    if _is_commanded(task):
        return {"published": {"speed_gain": 0.0, "yaw_gain": 0.0}, "usual": {}}
    brake = {"brake": pursuit_brake(task)}
    laws: dict[str, Settings] = {
        "published": brake,
        "usual": {**QUICK_PURSUIT, **brake},
        "gentle": {**GENTLE, **brake},
    }
    if FIXED["unhurried"].goes_with(task):
        usual = {"reserve": UnhurriedPursuit.reserve, **brake}
        laws["unhurried"] = {**usual, **unhurried_settings(task)}
    return laws


def draw_settings(rng: np.random.Generator, task: Task) -> Settings:
    """Draw settings: the gain of a pursuit log-uniformly, all others uniformly.

    A brake, to stop, and a lead, to catch what moves, only where a task asks for them. Where the
    time left is shown, half of the laws are `unhurried`.
    """
    if _is_commanded(task):
        return {
            "speed_gain": float(rng.uniform(0.0, 4.0)),
            "yaw_gain": float(rng.uniform(0.0, 4.0)),
            "speed": float(rng.uniform(9.0, 16.0)),
            "yaw_rate": float(rng.uniform(4.5, 8.0)),
        }
    settings = {
        "gain": float(np.exp(rng.uniform(np.log(0.3), np.log(4.0)))),
        "forward": float(rng.uniform(0.4, 1.5)),
        "weakest": float(rng.uniform(-0.5, 0.6)),
        "strongest": float(rng.uniform(0.8, 1.5)),
        "brake": float(rng.uniform(0.5, 4.0)) if pursuit_brake(task) else 0.0,
        "lead": float(rng.uniform(0.0, 0.6)) if "target_velocity" in task.slices() else 0.0,
    }
    if FIXED["unhurried"].goes_with(task) and rng.random() < 0.5:
        settings |= {
            "slowest": float(rng.uniform(0.4, 1.0)),
            "forward": float(rng.uniform(1.0, 1.5)),
            "speed": float(rng.uniform(5.0, 13.0)),
            "reserve": float(rng.uniform(0.2, 1.0)),
        }
    return settings


def score(records: list[EpisodeRecord]) -> float:
    """Share of successes; among equal ones the quicker law is better."""
    worth = [
        each.success - 0.1 * (each.duration_s if each.success else each.horizon_s) / each.horizon_s
        for each in records
    ]
    return float(np.mean(worth))


def stages(num_laws: int) -> list[tuple[int, int]]:
    """Laws that are still in, and episodes that each walks: successive halving, here by thirds.

    Jamieson and Talwalkar 2016, arXiv:1502.07943.
    """
    found, episodes = [], 8
    while num_laws > 1:
        found.append((num_laws, episodes))
        num_laws, episodes = round(num_laws / 3), 2 * episodes
    return found


def tuned(env: BatchedEnv, num_laws: int = NUM_LAWS, seed: int = 0) -> Settings:
    """Best of some laws, known and drawn, on training episodes, whose seeds are below 2**31."""
    rng = np.random.default_rng(seed)
    left = list(known(env.task).values())
    left += [draw_settings(rng, env.task) for _ in range(num_laws - len(left))]
    for count, episodes in stages(num_laws):
        drawn = [
            env.config.sample_episode(int(each)) for each in rng.integers(2**31, size=episodes)
        ]
        scores = [
            score(run_episodes(env, law(env.task, settings), drawn)) for settings in left[:count]
        ]
        left = [left[i] for i in np.argsort(-np.array(scores), kind="stable")]
    return left[0]
