"""A ground of one's own: stairs.

python examples/stairs.py
python train.py task=traverse terrain=examples.stairs:Stairs terrain.step_height=0.2
"""

from dataclasses import dataclass

import numpy as np

import flyrl
from flyrl.terrains import Bounds, Boxes, Terrain


@dataclass(frozen=True)
class Stairs(Terrain):
    """Stairs up along +x, from x = 3 mm on.

    Attributes
    ----------
    step_height, step_length : of every step, mm.
    unevenness : share by which steps are higher or lower, drawn uniformly.
    """

    step_height: float = 0.2
    step_length: float = 2.0
    unevenness: float = 0.0

    bounds = Bounds(-20.0, 40.0, -20.0, 20.0)

    def boxes(self, rng: np.random.Generator, difficulty: float) -> Boxes:
        """One box per step."""
        factors = 1 + self.unevenness * rng.uniform(-1, 1, size=len(self._starts))
        return self._steps(difficulty * self.step_height * np.cumsum(factors))

    def hull(self) -> Boxes:
        """Steps as high as they can be."""
        highest = self.step_height * (1 + self.unevenness)
        return self._steps(highest * np.arange(1, len(self._starts) + 1))

    @property
    def _starts(self) -> np.ndarray:
        return np.arange(3.0, self.bounds.x_max, self.step_length)

    def _steps(self, tops: np.ndarray) -> Boxes:
        centres = np.zeros((len(tops), 3))
        half_sizes = np.full((len(tops), 3), self.bounds.y_max)
        # a step reaches to the end of the stairs, below the next ones, and 1 mm into the ground
        centres[:, 0] = (self._starts + self.bounds.x_max) / 2
        half_sizes[:, 0] = (self.bounds.x_max - self._starts) / 2
        centres[:, 2] = (tops - 1) / 2
        half_sizes[:, 2] = (tops + 1) / 2
        return Boxes(centres, half_sizes)


def climb(step_height: float, controller: str = "hybrid", seed: int = 0) -> float:
    """How far a fly comes in 1.5 s on stairs, mm along +x."""
    terrain = Stairs(step_height=step_height)
    frame = flyrl.walk(controller, terrain=terrain, seconds=1.5, seed=seed).frame()
    return float(frame["x_mm"].iloc[-1] - frame["x_mm"].iloc[0])


if __name__ == "__main__":
    for height in (0.1, 0.2, 0.4):
        ways = {name: climb(height, name) for name in ("cpg", "rule_based", "hybrid")}
        print(f"steps of {height} mm:", *(f"{name} {way:.1f} mm" for name, way in ways.items()))
