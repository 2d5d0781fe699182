"""Pictures of the bodies of an environment."""

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.config import EnvConfig
from flyrl.simulation.rendering import FlyRenderer
from flyrl.simulation.scene import SceneConfig
from flyrl.simulation.worm_rendering import WormRenderer

RENDERING: Final[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 50}
"""What Gymnasium wants to know of the pictures; 50 per s are as fast as life in `Target`."""


class Renderer(Protocol):
    """Draws bodies with a camera that follows them."""

    def render(self, batch: Any, sim: int = 0, goal: tuple[float, ...] = ()) -> NDArray[np.uint8]:
        """Draw simulation `sim` of a batch, and the target at `goal` (x, y in mm), if any."""
        ...

    def close(self) -> None:
        """Free the GL context."""
        ...


def make_renderer(config: EnvConfig) -> Renderer:
    """Renderer of the bodies of an environment.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """
    scene = config.scene
    return FlyRenderer(scene) if isinstance(scene, SceneConfig) else WormRenderer(scene)


def check_render_mode(render_mode: str | None) -> str | None:
    """Return `render_mode` if pictures can be had that way, else raise ValueError."""
    if render_mode not in (None, *RENDERING["render_modes"]):
        raise ValueError(f"render_mode is {render_mode!r}; it must be None or 'rgb_array'")
    return render_mode
