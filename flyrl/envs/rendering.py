"""Pictures of the bodies of an environment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final

from flyrl.envs.config import EnvConfig
from flyrl.simulation.marks import PLAIN, Overlay
from flyrl.simulation.rendering import BodyRenderer, Camera
from flyrl.validation import Within, check_fields, one_of

RENDERING: Final[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 50}
"""What Gymnasium wants to know of the pictures; 50 per s are as fast as life in `Target`."""


LARGEST_SIDE: Final = 4096
"""Of a picture, px."""

IN_SCENE: Final = ("target", "leg_colours", "trace", "forces")
"""Fields of an Overlay that a renderer draws; the others are written onto videos afterwards."""

Drawn = Overlay | Sequence[str]
"""What is drawn beside the body: an Overlay, or names in `IN_SCENE`, those beside the target."""


@dataclass(frozen=True)
class View:
    """How pictures of an environment look.

    Parameters
    ----------
    camera
        "follow" looks from ahead, "top" straight down, "goal" from the start towards the target,
        where there is one (see `FlyRenderer`). A worm has no goal camera: there it is "follow".
    overlay
        What is drawn beside the body; names stand for an Overlay that has these and the target.
    width, height
        Of the picture, px.

    Raises
    ------
    ValueError
        There is no such camera or overlay, or a side is too long.
    """

    camera: Camera = "follow"
    overlay: Drawn = PLAIN
    width: Annotated[int, Within(1, LARGEST_SIDE)] = 640
    height: Annotated[int, Within(1, LARGEST_SIDE)] = 480

    def __post_init__(self) -> None:
        check_fields(self)
        if isinstance(self.overlay, str):
            raise ValueError(
                f"overlay must be an Overlay, or a list of {', '.join(IN_SCENE)}, got "
                f"{self.overlay!r}"
            )
        if not isinstance(self.overlay, Overlay):
            for name in self.overlay:
                one_of("overlay", name, IN_SCENE)

    @property
    def drawn(self) -> Overlay:
        """What is drawn beside the body."""
        if isinstance(self.overlay, Overlay):
            return self.overlay
        return replace(PLAIN, **dict.fromkeys(self.overlay, True))


USUAL_VIEW: Final = View()


def make_renderer(config: EnvConfig, view: View) -> BodyRenderer:
    """Renderer of the bodies of an environment.

    Raises
    ------
    RenderingUnavailableError
        If no GL context can be made.
    """
    drawn_by: type[BodyRenderer] = config.scene.batch_class.renderer
    camera = view.camera if view.camera in drawn_by.cameras else drawn_by.cameras[0]
    return drawn_by(config.scene, view.width, view.height, camera, view.drawn)
