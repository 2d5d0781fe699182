"""Made-up observations that trigger every reflex, alone and together."""

import numpy as np

from tests.controllers.kernels import Observation


def random_observations(num_steps: int, seed: int) -> list[Observation]:
    """Observations with legs in holes and legs that stumble, for 50 to 1,500 steps at a time."""
    random = np.random.default_rng(seed)
    heights = -1 + 0.02 * random.standard_normal((num_steps, 6))
    forces = 0.2 * random.standard_normal((num_steps, 36, 3))
    yaws = np.cumsum(0.01 * random.standard_normal(num_steps))
    headings = np.stack([np.cos(yaws), np.sin(yaws), np.zeros(num_steps)], axis=1)

    start = 0
    while start < num_steps:
        end = start + random.integers(50, 1500)
        if random.random() < 0.7:
            heights[start:end, random.integers(6)] -= 0.3
        start = end + random.integers(1, 60)
    for leg in range(6):
        start = random.integers(300)
        while start < num_steps:
            end = start + random.integers(5, 200)
            row = 6 * leg + random.integers(6)  # the last three segments of a leg must not count
            forces[start:end, row] -= 3 * headings[start:end]
            start = end + random.integers(100, 800)
    thorax_z = 0.05 * random.standard_normal(num_steps)
    return [
        Observation(float(z), z + height, force, heading)
        for z, height, force, heading in zip(thorax_z, heights, forces, headings, strict=True)
    ]


def random_drives(num_steps: int, seed: int) -> np.ndarray:
    """Drives, shape (num_steps, 2), that change every 200 steps and turn negative at times."""
    random = np.random.default_rng(seed)
    return np.repeat(random.uniform(-0.5, 1.5, (num_steps // 200 + 1, 2)), 200, axis=0)[:num_steps]
