"""One episode, in full: everything about it that was drawn at random."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeVar

import numpy as np

from flyrl.controllers.controller import NUM_LEGS
from flyrl.controllers.cpg import initial_oscillators
from flyrl.simulation.randomisation import UNVARIED, Randomisation
from flyrl.terrains import SPAWN_CLEARANCE, Bounds, Terrain
from flyrl.validation import FloatArray, Within, check_fields, ordered

Drawn = TypeVar("Drawn")

PUSH_S = 0.2
"""s; how long a push lasts. Where that is no whole number of decisions, it lasts for the nearest
number, and is the weaker or the stronger for it."""

PUSH_ARM = 1.5
"""mm; so far behind the middle of its thorax, at its abdomen, a push meets the fly."""

Six = tuple[float, float, float, float, float, float]

NO_OSCILLATORS: Final[Six] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Phases and magnitudes where there are no legs."""

FIRST_GROUND_SEED = 2**32
"""Beyond all seeds of episodes, so that a ground has nothing in common with what else is drawn."""


MOST_DRAWS: Final = 10_000
"""A goal that does not lie on the terrain is drawn again, so many times at most."""

EDGE_MARGIN: Final = 1.5
"""mm; no target or path comes closer to the terrain's edge; a spawn is 2 mm from it at least."""

WALKING_SPEED: Final = 13.0
"""mm/s that a drive of 1 on both sides brings about on flat ground."""

TIME: Final = Within(1e-4, 3600)
"""s; a time in a task lies within this."""

LENGTHS: Final = Within(-1e4, 1e4)
"""mm; places in an episode lie within this."""

_ANGLE: Final = Within(-1e4, 1e4)
_FORCE: Final = Within(-1e6, 1e6)


@dataclass(frozen=True)
class Episode:
    """Initial conditions of a simulation; the same episode gives the same bits.

    `Episode(**record)` gives back what `dataclasses.asdict` made of one, and JSON of that.

    Attributes
    ----------
    seed
        Seed that the rest was drawn with; also seeds the rule-based controller's choices.
    spawn_position_w
        Place of the fly, mm (x, y, z); the thorax is at `bodies.spawn_offset` from it. Of a
        worm, where its middle is.
    spawn_yaw
        Heading from +x, rad; of a worm the direction from its tail to its head.
    goal
        Goal of the task: x and y in mm, or nothing.
    init_phases, init_magnitudes
        State of the six oscillators, rad and 1, ordered as anatomy.LEGS.
    command
        Command of the task, as its terms read it: in `velocity` speed (mm/s) and yaw rate
        (rad/s) of each second, in `path` x and y (mm) of every point, in `heading` an angle (rad),
        in `worm_hang` a bend (rad).
    pushes
        Sideways pushes for PUSH_S each: when (s since the reset) and how hard to the fly's left
        (µN), in turn. They turn the fly to the other side, for they meet its abdomen.
    ground
        On random terrain, the seed of its heights and gaps, for `Terrain.draw`; None: the
        one that goes with `seed`, so that another seed is another ground.
    randomisation
        Differences of the fly from the scene's.
    difficulty
        That it was drawn with, from 0 to 1, the usual one. Random ground is laid with it too: a
        factor on its heights and gaps.
    joint_angles
        Angles of a worm's joints at the start, rad; none: it is straight.
    props
        Initial places of the task's props: x, y and z of the middle of each, mm, but for those
        that stand at the goal. `flyrl.terrains.NOWHERE` leaves one out.
    """

    seed: Annotated[int, Within(0, 2**63 - 1)]
    spawn_position_w: Annotated[tuple[float, float, float], LENGTHS]
    spawn_yaw: Annotated[float, _ANGLE]
    goal: Annotated[tuple[float, ...], LENGTHS]
    init_phases: Annotated[Six, _ANGLE] = NO_OSCILLATORS
    init_magnitudes: Annotated[Six, Within(0, 100)] = NO_OSCILLATORS
    command: Annotated[tuple[float, ...], LENGTHS] = ()
    pushes: Annotated[tuple[float, ...], _FORCE] = ()
    ground: Annotated[int | None, Within(0, 2**63 - 1)] = None
    randomisation: Randomisation = UNVARIED
    difficulty: Annotated[float, Within(0, 1)] = 1.0
    joint_angles: Annotated[tuple[float, ...], _ANGLE] = ()
    props: Annotated[tuple[float, ...], LENGTHS] = ()

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def ground_seed(self) -> int:
        """Seed of the ground on random terrain."""
        return FIRST_GROUND_SEED + self.seed if self.ground is None else self.ground


def beyond_reach(name: str, distances: tuple[float, float], reach: float) -> tuple[float, float]:
    """Least and greatest of `distances`, mm; ValueError unless both lie beyond `reach`."""
    near, far = ordered(name, distances)
    if reach >= near:
        raise ValueError(f"task.reach must be below the least {name}, {near}, got {reach}")
    return near, far


def is_inside(x: Any, y: Any, bounds: Bounds, margin: float = 0.0) -> Any:
    """Whether places (...) lie on the terrain, at least `margin`, mm, from its edge, (...)."""
    return (
        (bounds.x_min + margin <= x)
        & (x <= bounds.x_max - margin)
        & (bounds.y_min + margin <= y)
        & (y <= bounds.y_max - margin)
    )


def draw_inside(
    bounds: Bounds, settings: str, given: object, draw: Callable[[], tuple[FloatArray, Drawn]]
) -> Drawn:
    """Draw again until all places lie on the terrain, `EDGE_MARGIN` from its edge.

    Parameters
    ----------
    settings, given
        Names and values of what may leave no room, for the message.
    draw
        Gives places, mm, (k, 2), and what is drawn.

    Raises
    ------
    ValueError
        If the terrain has no room: `MOST_DRAWS` draws were beyond it.
    """
    for _ in range(MOST_DRAWS):
        places, drawn = draw()
        if is_inside(places[:, 0], places[:, 1], bounds, EDGE_MARGIN).all():
            return drawn
    raise ValueError(
        f"{settings} must leave room on the terrain, of x from {bounds.x_min:g} to "
        f"{bounds.x_max:g} and y from {bounds.y_min:g} to {bounds.y_max:g} mm, got {given}"
    )


def draw_spawn(terrain: Terrain, rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a spawn position on a terrain, mm."""
    area = terrain.spawn
    x, y = rng.uniform((area.x_min, area.y_min), (area.x_max, area.y_max))
    return float(x), float(y), terrain.base_height + SPAWN_CLEARANCE


def draw_oscillators(seed: int) -> tuple[Six, Six]:
    """Draw initial phases U(0, 2π), then magnitudes U(0, 1), as `CPGNetwork` does for a seed."""
    random_state = np.random.RandomState(seed)
    phases, magnitudes = initial_oscillators(random_state, np.ones(NUM_LEGS), None, None)
    return tuple(phases.tolist()), tuple(magnitudes.tolist())
