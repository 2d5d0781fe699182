"""How far the classic body walks, beside FlyGym's tutorial: `python -m benchmarks.walking`.

Rough ground: `benchmarks.fidelity walking`. Rest and turns: tests/test_walking.py.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.fidelity.flyrl_runs import drive
from flyrl.bodies.fly import FlyConfig
from flyrl.bodies.surface import ContactConfig
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.simulation.physics import PHYSICS_PRESETS

SAMPLING_S = 4e-3
"""A multiple of every preset's step."""

PUBLISHED = replace(PHYSICS_PRESETS["reference"], noslip_iterations=100, contact=ContactConfig())
"""As the published models, which have 100 no-slip iterations. Capsules on planes come closer to
flygym 0.2.5 than the preset's hulls (rules, a middle leg first: 3.26, 3.51; flygym 3.32 mm)."""


def walk(
    drives: tuple[float, float],
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
    drives, seconds, conditions
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
    settings = EnvConfig(task="hybrid_turning", decision_interval=SAMPLING_S, **config)
    settling = round(settle / SAMPLING_S)
    series, _, _ = drive(
        BatchedEnv(settings, conditions, num_threads),
        range(conditions),
        lambda k: np.tile(drives if k >= settling else (0.0, 0.0), (conditions, 1)),
        settling + round(seconds / SAMPLING_S),
        magnitude=magnitude,
        walks_on=True,
    )
    return series["position_w"][settling:], np.unwrap(series["yaw"][settling:], axis=0)


def speed(positions: np.ndarray, seconds: float) -> np.ndarray:
    """Straight-line speed from start to end, mm/s, (n,)."""
    displacement = positions[-1, :, :2] - positions[0, :, :2]
    speeds: np.ndarray = np.hypot(displacement[:, 0], displacement[:, 1]) / seconds
    return speeds


def main() -> None:
    """Print the distance in 0.5 s at 1e-4 s, classic body, against FlyGym's tutorial."""
    print("classic body, flat, 0.5 s at 1e-4 s: distance along x (mm)")
    print("  published single runs: CPG 4.9, rules 2.6")
    print("  flygym 0.2.5, median of seeds 0-19: rules 3.23")
    for controller in ("cpg", "rule_based"):
        body = FlyConfig("classic", symmetric=False)
        positions, _ = walk((1, 1), 0.5, body=body, controller=controller, physics=PUBLISHED)
        low, median, high = np.percentile((positions[-1] - positions[0])[:, 0], [25, 50, 75])
        print(f"  {controller:10} {median:5.2f}  (quartiles {low:.2f} and {high:.2f})")


if __name__ == "__main__":
    main()
