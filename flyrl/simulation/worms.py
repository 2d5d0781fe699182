"""Worms: their scene, how they start, how a command reaches their muscles, what their state is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.bodies.worm import CRAWLING_ROOT, WormConfig, build_worm
from flyrl.muscles import attach_muscles, pack_muscles
from flyrl.simulation.batch import Batch, Ids
from flyrl.simulation.physics import PHYSICS_PRESETS, apply_physics
from flyrl.simulation.rendering import WormRenderer
from flyrl.simulation.scene import Scene, SceneConfig, pair_with_planes
from flyrl.terrains import add_terrain
from flyrl.terrains.geoms import add_sky
from flyrl.validation import FloatArray, one_of


def add_surroundings(spec: mujoco.MjSpec) -> None:
    """Add a sky, and what holds a worm's first segment, to its specification, in place."""
    add_sky(spec, (0.62, 0.69, 0.76), (0.88, 0.90, 0.92), pixels=64)
    radius = spec.geom("Segment1").size[0]
    spec.worldbody.add_geom(
        name="holder",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(1.6 * radius, 1.6 * radius, 0.5 * radius),
        pos=(0, 0, -0.5 * radius),
        rgba=(0.35, 0.38, 0.42, 1),
        contype=0,
        conaffinity=0,
    )


def side_view(config: WormConfig) -> mujoco.MjvCamera:
    """Look along +y at the whole worm, which is suspended along +z and bends to +x."""
    length = config.segments * config.segment_length
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, -4.0, 1.7 * length
    camera.lookat[:] = (0.15 * length, 0.0, 0.45 * length)
    return camera


HANGING_CLEARANCE: Final = 2.0
"""How far above the ground the end of a hanging worm's tail is, mm."""


@dataclass(frozen=True)
class WormState:
    """A snapshot of n simulations of a worm with J joints and M muscles.

    The first axis of every array is the simulation.

    Attributes
    ----------
    time
        s since the reset, (n,).
    position_w, velocity_w
        Mean of the middles of all segments, mm and mm/s, (n, 3), world frame.
    yaw
        Direction from the last segment's middle to the first one's: angle from +x,
        counter-clockwise from above, rad in [-pi, pi], (n,); 0 of a hanging worm.
    joint_angles, joint_velocities
        rad, rad/s, (n, J), head to tail.
    neurons
        Up to which neuron each muscle is recruited, as last commanded: whole numbers, (n, M).
    tensions
        Of the muscles, with these neurons recruited, from 0 to 1, (n, M).
    is_unstable
        Whether the simulation blew up since its reset, (n,).
    """

    time: FloatArray
    position_w: FloatArray
    velocity_w: FloatArray
    yaw: FloatArray
    joint_angles: FloatArray
    joint_velocities: FloatArray
    neurons: FloatArray
    tensions: FloatArray
    is_unstable: NDArray[np.bool_]

    @property
    def actuation(self) -> FloatArray:
        """What the worm does by command, as a rollout records it: `tensions`."""
        return self.tensions

    @property
    def bend(self) -> FloatArray:
        """Sum of the joints' angles, rad, (n,)."""
        total: FloatArray = self.joint_angles.sum(axis=1)
        return total


class WormBatch(Batch):
    """Worms of one scene; parameters are those of `Batch`."""

    creature = "worm"
    renderer = WormRenderer
    presets = tuple(PHYSICS_PRESETS)
    usual_physics = "worm"
    needless = ("init_phases", "init_magnitudes", "pushes", "ground", "props")

    @classmethod
    def fit(cls, config: SceneConfig) -> None:
        """A worm has no controller, as its muscles are recruited from outside.

        Raises
        ------
        ValueError
            If the worm neither crawls nor hangs, or has not two muscles per joint, or the ground is
            not flat, or there are props.
        """
        one_of("the mount of a worm in a scene", config.body.mount, ("crawling", "hanging"))
        one_of("muscles of a worm in a scene", config.body.muscles, ("pairs",))
        one_of("terrain of a worm", config.terrain.label, ("flat",))
        if config.props:
            raise ValueError(f"props of a worm must be (), got {config.props!r}")

    @classmethod
    def build(cls, config: SceneConfig, visual: bool) -> Scene:
        """Compile a scene.

        A crawling worm touches the ground with its feet. A hanging one hangs above it, and touches
        nothing.
        """
        body = config.body
        spec = build_worm(body)
        if body.mount == "hanging":
            height = body.segments * body.segment_length + body.radius + HANGING_CLEARANCE
            for name in ("muscles", "Segment1"):
                spec.body(name).pos[2] += height
        muscles = tuple(attach_muscles(spec, body.profile_path.parent))
        add_terrain(spec, config.terrain)
        pair_with_planes(spec, body.friction_across)
        apply_physics(spec, config.physics, config.terrain)
        spec.nuserdata = 2 * len(muscles)  # their neurons, then their tensions
        if visual:
            for geom in spec.worldbody.geoms:
                if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                    geom.size[:2] = 0.0  # drawn without an end, as it is for what stands on it
        model = spec.compile()
        joints = [model.joint(f"joint_{i}") for i in range(1, body.segments)]
        return Scene(
            config=config,
            model=model,
            joint_qpos=np.array([joint.qposadr[0] for joint in joints]),
            joint_dofs=np.array([joint.dofadr[0] for joint in joints]),
            userdata=np.dtype(np.float64),
            muscles=muscles,
        )

    def __init__(self, scene: Scene, num_sims: int = 1, num_threads: int = 0) -> None:
        super().__init__(scene, num_sims, num_threads)
        segments = range(1, scene.config.body.segments + 1)
        self.segment_geoms = np.array([scene.model.geom(f"Segment{i}").id for i in segments])
        self._pools = pack_muscles([attached.muscle for attached in scene.muscles])
        self._neurons, self._tensions = np.hsplit(self._userdata, 2)
        self._ctrl = self._batch.bind("ctrl")
        self._middles = self._batch.bind("geom_xpos")
        self._axes = self._batch.bind("xaxis")
        self._anchors = self._batch.bind("xanchor")
        self._crawls = scene.config.body.mount == "crawling"

    def start(self, ids: Ids, episodes: Sequence[Any]) -> None:
        """Put worms at rest where episodes start, straight where these do not say how bent.

        No more than the first neuron is recruited. The others are not touched.

        Raises
        ------
        ValueError
            If an episode has not one angle per joint, or another place for a hanging worm.
        """
        joints = len(self.scene.joint_qpos)
        for episode in episodes:
            if len(episode.joint_angles) not in (0, joints):
                raise ValueError(
                    f"joint_angles of the episode must be {joints} angles, or none, got "
                    f"{len(episode.joint_angles)}"
                )
            asked = (
                ("spawn_position", episode.spawn_position_w[:2]),
                ("spawn_yaw", (episode.spawn_yaw,)),
            )
            for name, given in asked:
                if not self._crawls and any(given):
                    raise ValueError(
                        f"{name} of a hanging worm must be 0, got {max(given, key=abs)}"
                    )
        self._clear(ids)
        self.set_command(np.zeros((len(ids), len(self.scene.muscles))), ids)
        self._qpos[np.ix_(ids, self.scene.joint_qpos)] = [
            episode.joint_angles or (0.0,) * joints for episode in episodes
        ]
        self._forward(ids)
        if not self._crawls:
            return
        # its head is at x = y = yaw = 0 now: from there, turn it and move it
        places = np.array([episode.spawn_position_w for episode in episodes])
        turns = [episode.spawn_yaw for episode in episodes] - self._yaw()[ids]
        x, y, _ = self._mean_middle()[ids].T
        cos, sin = np.cos(turns), np.sin(turns)
        self._qpos[ids, 0] = places[:, 0] - (cos * x - sin * y)
        self._qpos[ids, 1] = places[:, 1] - (sin * x + cos * y)
        self._qpos[ids, 3] = turns
        self._forward(ids)

    def set_command(self, command: ArrayLike, ids: Ids | slice = slice(None)) -> None:
        """Recruit muscles from the next physics step on.

        Parameters
        ----------
        command
            Up to which neuron, whole numbers, (k, M) in the order of `scene.muscles`. Beyond the
            pool they count as its first or last one.
        ids
            Simulations, (k,).
        """
        self._neurons[ids] = command
        self._tensions[ids] = self._pools.tensions(self._neurons[ids])
        self._ctrl[ids] = self._pools.strengths * self._tensions[ids]

    def state(self) -> WormState:
        """Copy what the simulations look like now."""
        scene = self.scene
        return WormState(
            time=self._time.copy(),
            position_w=self._mean_middle(),
            velocity_w=self._mean_velocity(),
            yaw=self._yaw(),
            joint_angles=self._qpos[:, scene.joint_qpos],
            joint_velocities=self._qvel[:, scene.joint_dofs],
            neurons=self._neurons.copy(),
            tensions=self._tensions.copy(),
            is_unstable=self._is_unstable.copy(),
        )

    # Sums over segments are loops: in NumPy's, the order may depend on the number of simulations.

    def _mean_middle(self) -> FloatArray:
        """Mean of the segments' middles, (n, 3)."""
        total = np.zeros((self.num_sims, 3))
        for geom in self.segment_geoms:
            total += self._middles[:, geom]
        return total / len(self.segment_geoms)

    def _mean_velocity(self) -> FloatArray:
        """Velocity of the mean of the segments' middles, (n, 3).

        Every joint turns the middles of all segments behind it about its anchor.
        """
        scene = self.scene
        total = np.zeros((self.num_sims, 3))
        behind = np.zeros((self.num_sims, 3))
        hinges = [*scene.joint_dofs]
        if self._crawls:
            hinges.insert(0, scene.model.joint(CRAWLING_ROOT[3]).dofadr[0])
        geoms = self.segment_geoms[-len(hinges) :]
        # all joints are hinges and slides, so a joint's number is that of its degree of freedom
        for count, (dof, geom) in enumerate(zip(hinges[::-1], geoms[::-1], strict=True), start=1):
            behind += self._middles[:, geom]
            lever = behind - count * self._anchors[:, dof]
            total += self._qvel[:, dof, np.newaxis] * np.cross(self._axes[:, dof], lever)
        total /= len(self.segment_geoms)
        return total + self._qvel[:, :3] if self._crawls else total

    def _yaw(self) -> FloatArray:
        """Direction from the last segment's middle to the first one's, (n,)."""
        if not self._crawls:
            return np.zeros(self.num_sims)
        first, last = self.segment_geoms[[0, -1]]
        x = self._middles[:, first, 0] - self._middles[:, last, 0]
        y = self._middles[:, first, 1] - self._middles[:, last, 1]
        yaw: FloatArray = np.arctan2(y, x)
        return yaw
