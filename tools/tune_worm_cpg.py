"""Search the settings of the worm's CPG by how far it crawls: those of `WormCPG` come from here.

Run from the repository: python tools/tune_worm_cpg.py
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np

from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.policies import WormCPG
from flyrl.progress import progress_bar
from flyrl.rollouts import run_episodes

Setting = tuple[float, float, float]
"""Frequency (Hz), waves along the worm, amplitude."""

COARSE: Final[list[Setting]] = [
    *itertools.product(
        (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0),
        (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0),
        (0.3, 0.4, 0.5, 0.6, 0.75, 1.0),
    )
]

FIRST_SEED: Final = 2**31
"""Of the episodes; no training and no evaluation has them."""


def around(setting: Setting) -> list[Setting]:
    """Finer settings on either side of one."""
    frequency_hz, waves, amplitude = setting
    return [
        *itertools.product(
            (frequency_hz - 0.25, frequency_hz, frequency_hz + 0.25),
            (waves - 0.05, waves, waves + 0.05),
            (amplitude - 0.1, amplitude - 0.05, amplitude, amplitude + 0.05, amplitude + 0.1),
        )
    ]


def advances_mm(grid: Sequence[Setting], episodes: int) -> dict[Setting, float]:
    """Mean way along +x of each setting, mm."""
    config = EnvConfig(task="worm_crawl")
    env = BatchedEnv(config, episodes)
    drawn = [config.sample_episode(FIRST_SEED + i) for i in range(episodes)]
    found = {}
    with progress_bar(len(grid), is_shown=True, unit="setting", description="crawling") as bar:
        for frequency_hz, waves, amplitude in grid:
            policy = WormCPG(
                config.resolved_task,
                frequency_hz=frequency_hz,
                waves=waves,
                amplitude=amplitude,
            )
            records = run_episodes(env, policy, drawn)
            ways = [record.position_w[-1, 0] - record.position_w[0, 0] for record in records]
            found[frequency_hz, waves, amplitude] = float(np.mean(ways))
            bar.update()
    return found


def main() -> None:
    """Search coarsely, then finely around the best; print the best settings, the best first."""
    parser = argparse.ArgumentParser(description="Search the settings of the worm's CPG.")
    parser.add_argument("--episodes", type=int, default=16, help="per setting (default: 16)")
    parser.add_argument("--shown", type=int, default=10, help="how many (default: 10)")
    options = parser.parse_args()
    found = advances_mm(COARSE, options.episodes)
    best = max(found, key=lambda setting: found[setting])
    found |= advances_mm(around(best), options.episodes)
    print("frequency (Hz)  waves  amplitude  way in 5 s (mm)")
    for setting in sorted(found, key=lambda setting: -found[setting])[: options.shown]:
        frequency_hz, waves, amplitude = setting
        print(f"{frequency_hz:14g}{waves:7g}{amplitude:11g}{found[setting]:17.1f}")


if __name__ == "__main__":
    main()
