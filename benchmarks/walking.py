"""How the fly walks: the figures of the literature beside ours.

Run `python benchmarks/walking.py` for every figure, or name some:
`python benchmarks/walking.py literature rest turning`. Rough ground: `benchmarks.fidelity walking`.
"""

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from flyrl.bodies.fly import FlyConfig
from flyrl.bodies.surface import ContactConfig
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PHYSICS_PRESETS
from flyrl.tasks import TASKS

FIRST_SEED = 0

SAMPLING_S = 4e-3
"""A multiple of every preset's step."""

PUBLISHED = replace(PHYSICS_PRESETS["reference"], noslip_iterations=100, contact=ContactConfig())
"""As the published models, which have 100 no-slip iterations. Capsules on planes come closer to
flygym 0.2.5 than the preset's hulls (rules, a middle leg first: 3.26, 3.51; flygym 3.32 mm)."""


def walk(
    drive: tuple[float, float],
    seconds: float,
    conditions: int = 20,
    magnitude: float | None = None,
    settle: float = 0.0,
    num_threads: int = 0,
    **config: Any,
) -> tuple[np.ndarray, np.ndarray]:
    """Walk under a steady drive from paired initial conditions.

    Parameters
    ----------
    drive, seconds, conditions
        Drive (left, right), duration, and number of initial conditions.
    magnitude
        Initial magnitude of the oscillators; None draws it.
    settle
        s of zero drive before the first sample.
    num_threads
        0 takes one per CPU.
    config
        Arguments of `EnvConfig`.

    Returns
    -------
    Thorax positions, mm, (t, n, 3), and yaws, rad, (t, n), every `SAMPLING_S`.
    """
    env = BatchedEnv(
        EnvConfig(task="hybrid_turning", decision_interval=SAMPLING_S, **config),
        conditions,
        num_threads,
    )
    terrain = env.config.scene.terrain
    episodes = [
        TASKS["hybrid_turning"]().sample_episode(terrain, FIRST_SEED + i) for i in range(conditions)
    ]
    if magnitude is not None:
        episodes = [replace(episode, init_magnitudes=(magnitude,) * 6) for episode in episodes]
    env.reset(episodes=episodes)
    for _ in range(round(settle / SAMPLING_S)):
        env.step(np.zeros((conditions, 2)))
    action = np.tile(drive, (conditions, 1))
    positions, yaws = [env.state.position_w], [env.state.yaw]
    for _ in range(round(seconds / SAMPLING_S)):
        env.step(action)
        positions.append(env.state.position_w)
        yaws.append(env.state.yaw)
    return np.array(positions), np.unwrap(np.array(yaws), axis=0)


def speed(positions: np.ndarray, seconds: float) -> np.ndarray:
    """Straight-line speed from start to end, mm/s, (n,)."""
    displacement = positions[-1, :, :2] - positions[0, :, :2]
    speeds: np.ndarray = np.hypot(displacement[:, 0], displacement[:, 1]) / seconds
    return speeds


def literature() -> None:
    """Distance in 0.5 s at 1e-4 s, classic body, against FlyGym's tutorial."""
    print("classic body, flat, 0.5 s at 1e-4 s: distance along x (mm)")
    print("  published single runs: CPG 4.9, rules 2.6")
    print("  flygym 0.2.5, median of seeds 0-19: rules 3.23")
    for controller in ("cpg", "rule_based"):
        body = FlyConfig("classic", symmetric=False)
        positions, _ = walk((1, 1), 0.5, body=body, controller=controller, physics=PUBLISHED)
        low, median, high = np.percentile((positions[-1] - positions[0])[:, 0], [25, 50, 75])
        print(f"  {controller:10} {median:5.2f}  (quartiles {low:.2f} and {high:.2f})")


def rest() -> None:
    """Zero drive from zero magnitude."""
    for body in ("classic", "current"):
        positions, _ = walk((0, 0), 0.5, magnitude=0.0, settle=0.5, body=body)
        moved = np.linalg.norm(positions[-1, :, :2] - positions[0, :, :2], axis=1)
        median, largest = np.median(moved), moved.max()
        print(f"zero drive, {body}: moved {median:.3f} mm in 0.5 s (largest {largest:.3f})")


def turning() -> None:
    """Turning, straight walking and walking backwards of the hybrid controller."""
    for drive in ((1.2, 0.2), (0.2, 1.2), (1.0, 1.0), (-0.5, -0.5)):
        positions, yaws = walk(drive, 1.0)
        turned = np.rad2deg(yaws[-1] - yaws[0])
        way = positions[-1] - positions[0]
        drift = np.rad2deg(np.arctan2(way[:, 1], way[:, 0]))
        print(
            f"drive {drive}: turned {np.median(turned):7.1f} deg in 1 s, x "
            f"{np.median(way[:, 0]):6.2f} mm, drift {np.median(drift):5.1f} deg "
            f"(median size {np.median(np.abs(drift)):5.1f})"
        )


STUDIES = {"literature": literature, "rest": rest, "turning": turning}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", help=f"among {list(STUDIES)}; default all")
    chosen = parser.parse_args().studies or list(STUDIES)
    for name in chosen:
        if name not in STUDIES:
            parser.error(f"unknown study {name!r}; choose from {list(STUDIES)}")
        STUDIES[name]()
