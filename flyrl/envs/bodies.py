"""Bodies of an environment: as it steps them, with what episodes ask for, and pictures of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, Literal, cast

import numpy as np
from numpy.typing import NDArray

from flyrl.envs.config import EnvConfig
from flyrl.simulation.batch import Batch, Ids
from flyrl.simulation.flies import FlyBatch, FlyState
from flyrl.simulation.marks import PLAIN, Overlay
from flyrl.simulation.randomisation import UNVARIED
from flyrl.simulation.rendering import BodyRenderer, Camera
from flyrl.simulation.scene import build_scene
from flyrl.tasks import Episode
from flyrl.tasks.episode import PUSH_ARM, PUSH_S, is_inside
from flyrl.terrains import NOWHERE
from flyrl.validation import Within, check_fields

ABOVE_GROUND: Final = 0.02
"""mm; a marker lies that far above the ground, to be seen."""


class Bodies:
    """Bodies of one environment, started and pushed as episodes say.

    Parameters
    ----------
    config
        The settings.
    num_envs, num_threads
        Number of bodies, and of native threads; 0 takes one per CPU.

    Attributes
    ----------
    batch
        Their physics.
    pushes
        Start, s, and strength, µN, to the left, of each episode's pushes, (num_envs, 2 k).
    """

    def __init__(self, config: EnvConfig, num_envs: int, num_threads: int) -> None:
        scene = config.scene
        self.batch: Batch = scene.batch_class(build_scene(scene), num_envs, num_threads)
        self._config = config
        self._scene = scene
        self.pushes = np.zeros((num_envs, 0))
        self._decisions_per_push = max(1, round(PUSH_S / config.decision_interval_s))

    def start(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Start episodes, one per simulation in `ids` (sorted).

        Raises
        ------
        ValueError
            If an episode starts beside the ground or below it, asks for what these bodies cannot
            do, brings a ground where the terrain is not random, or more latency than the settings
            have.
        """
        for episode in episodes:
            self._check(episode)
        terrain = self._scene.terrain
        if terrain.random:
            grounds = [terrain.draw(each.ground_seed, each.difficulty) for each in episodes]
            self.batch.set_ground(ids, grounds)
        self.batch.vary(ids, [episode.randomisation for episode in episodes])
        self.batch.start(ids, episodes)
        self._set_pushes(ids, episodes)
        if self._scene.props:
            self._set_props(ids, episodes)

    def set_goals(self, ids: Ids, goals: NDArray[np.float64]) -> None:
        """Put the props that stand where episodes lead to elsewhere: x, y, mm, (k, 2)."""
        starts = self.batch.prop_starts[ids]
        for row, sim, goal in zip(starts, ids, goals, strict=True):
            self._put_on_ground(row, int(sim), goal)
        self.batch.set_props(ids, starts)

    def _set_props(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Put the props of episodes where these say."""
        placed = [i for i, prop in enumerate(self._scene.props) if not prop.at_goal]
        for sim, episode in zip(ids, episodes, strict=True):
            if len(episode.props) != 3 * len(placed):
                raise ValueError(
                    f"props of the episode must be x, y and z of {len(placed)} props, got "
                    f"{len(episode.props)} numbers"
                )
            row = self.batch.prop_starts[sim]
            row[placed] = np.reshape(episode.props, (-1, 3))
            self._put_on_ground(row, int(sim), episode.goal)
        commands = np.array([episode.command for episode in episodes])
        self.batch.set_props(ids, self.batch.prop_starts[ids], commands)

    def _put_on_ground(self, row: NDArray[np.float64], sim: int, goal: Sequence[float]) -> None:
        """Put props of one simulation, (props, 3), at its goal, if it has one; lay markers down."""
        terrain = self._scene.terrain
        for place, prop in zip(row, self._scene.props, strict=True):
            if prop.at_goal and len(goal):
                place[:2] = goal[0], goal[1]
            elif prop.at_goal or prop.shape != "marker" or place[2] <= NOWHERE[2]:
                continue
            top = terrain.top_at(self.batch.ground(sim), place[0], place[1])
            foot = terrain.base_height if top is None else top
            place[2] = foot + prop.height / 2 + ABOVE_GROUND

    def _check(self, episode: Episode) -> None:
        """Raise ValueError if an episode asks for what these bodies or the settings do not have."""
        bounds, low = self._scene.terrain.bounds, self._scene.terrain.base_height
        x, y, z = episode.spawn_position_w
        if not is_inside(x, y, bounds) or (self.batch.has_legs and z < low):
            raise ValueError(
                f"spawn_position must lie on the ground, with x from {bounds.x_min:g} to "
                f"{bounds.x_max:g}, y from {bounds.y_min:g} to {bounds.y_max:g} and z of at least "
                f"{low:g} mm, got {episode.spawn_position_w}"
            )
        body = f"of an episode of a {self.batch.creature}"
        for name in self.batch.needless:
            given, nothing = getattr(episode, name), getattr(Episode, name)
            if given != nothing:
                raise ValueError(f"{name} {body} must be {nothing}, got {given}")
        terrain = self._scene.terrain
        if episode.ground is not None and not terrain.random:
            raise ValueError(
                f"ground of the episode is {episode.ground}; it must be None where terrain.random "
                f"is false, as on {terrain.name!r}"
            )
        drawn = episode.randomisation
        if not self.batch.has_legs and replace(drawn, sensor_noise=0.0) != UNVARIED:
            raise ValueError(f"randomisation {body} must be of its senses alone, got {drawn}")
        longest = self._config.resolved_randomisation.longest_latency
        if drawn.drive_latency > longest:
            raise ValueError(
                f"randomisation.drive_latency is {drawn.drive_latency} s; the environment's own "
                f"allows at most {longest} s"
            )

    def _set_pushes(self, ids: Ids, episodes: Sequence[Episode]) -> None:
        """Note the pushes of episodes that start; a push of 0 µN is none."""
        most = max(len(episode.pushes) for episode in episodes)
        missing = max(0, most - self.pushes.shape[1])
        self.pushes = np.pad(self.pushes, ((0, 0), (0, missing)))
        self.pushes[ids] = 0.0
        for i, episode in zip(ids, episodes, strict=True):
            self.pushes[i, : len(episode.pushes)] = episode.pushes

    def push(self, now: FlyState, moved: Ids | slice) -> None:
        """Push flies as hard as is due in this decision, with all of them as they are `now`."""
        start, strength = self.pushes[:, ::2], self.pushes[:, 1::2]
        duration = self._decisions_per_push * self._config.decision_interval_s
        since = now.time[:, None] - start
        # but for rounding: a push that starts with a decision lasts no decision more
        is_due = (since > -1e-6) & (since < duration - 1e-6)
        to_the_left = np.where(is_due, strength, 0.0).sum(axis=1) * (PUSH_S / duration)
        yaw = now.yaw
        force_w = to_the_left[:, None] * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
        cast(FlyBatch, self.batch).push(force_w[moved], -PUSH_ARM * to_the_left[moved], moved)


RENDERING: Final[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 50}
"""Gymnasium's metadata of pictures; 50 per s are real time in `Target`."""

LARGEST_SIDE: Final = 4096
"""Longest side of a picture, px."""

InScene = Literal["target", "leg_colours", "trace", "forces"]
"""Fields of an Overlay that a renderer draws; the others are written onto videos afterwards."""


@dataclass(frozen=True)
class View:
    """Camera, overlay and size of an environment's pictures.

    Parameters
    ----------
    camera
        "follow" looks from ahead, "top" straight down, "goal" from the start towards the target,
        where there is one (see `FlyRenderer`). A worm has no goal camera: there it is "follow".
    overlay
        Marks beside the body; names stand for an Overlay that has these and the target.
    width, height
        Size of the picture, px.

    Raises
    ------
    ValueError
        There is no such camera or overlay, or a side is too long.
    """

    camera: Camera = "follow"
    overlay: Overlay | tuple[InScene, ...] = PLAIN
    width: Annotated[int, Within(1, LARGEST_SIDE)] = 640
    height: Annotated[int, Within(1, LARGEST_SIDE)] = 480

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def drawn(self) -> Overlay:
        """The overlay, in full."""
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
