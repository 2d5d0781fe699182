"""Flies: their state, and many of them in one batch."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.anatomy import END_EFFECTORS
from flyrl.bodies.fly import spawn_offset, start_pose
from flyrl.controllers import PreprogrammedSteps
from flyrl.simulation.batch import Batch, Ids
from flyrl.simulation.fly_scene import STEPS_OF_BODY, build_fly_scene, leg_controller
from flyrl.simulation.physics import FLY_PRESETS
from flyrl.simulation.rendering import FlyRenderer
from flyrl.simulation.scene import Scene
from flyrl.terrains.smooth import BALL, Ball
from flyrl.validation import FloatArray


@dataclass(frozen=True)
class FlyState:
    """A snapshot of n simulations; the first axis of every array is the simulation.

    Attributes
    ----------
    time
        s since the reset, (n,).
    position_w, velocity_w
        Thorax, mm and mm/s, (n, 3), world frame.
    rotation_w
        Thorax to world, (n, 3, 3); its first column is the heading.
    angular_velocity_w
        Thorax, rad/s, (n, 3), world frame.
    joint_angles, joint_velocities, actuator_torques
        rad, rad/s, µN·mm, (n, 42), ordered as anatomy.JOINTS; no torque before the first step.
    contact_forces_w
        Sum of the ground's forces on each sensed segment in the last physics step, µN,
        (n, 36, 3), ordered as anatomy.CONTACT_SEGMENTS.
    is_grounded
        1 for each leg that the ground pushed harder than `gait_log.CONTACT_THRESHOLD` then, else 0,
        (n, 6).
    end_effectors_w
        Tarsus5 of each leg, mm, (n, 6, 3).
    command
        What the leg controller was last commanded, (n, k), for most the descending drive (left,
        right): what the brain knows of. With latency it is at the legs only later.
    phases, magnitudes
        Of the legs' oscillators (or steps, for the rule-based controller), rad and 1, (n, 6);
        zeros for a controller without.
    retraction, stumbling
        Correction amounts of the two reflexes, (n, 6); zeros for a controller without.
    adhesion
        1 while a leg grips, else 0, (n, 6).
    muscle_tensions
        Of the legs' muscles, from 0 to 1: at each joint, ordered as anatomy.JOINTS, of the one that
        turns it to positive angles, then of the other, (n, 84); (n, 0) of a fly without muscles.
    fictive_velocity_b
        Of a tethered fly, the way that the ball turns back under it: forward and leftward, mm/s,
        and yaw rate, rad/s, (n, 3); zeros without a ball.
    is_unstable
        Whether the simulation blew up since its reset, (n,).
    """

    time: FloatArray
    position_w: FloatArray
    velocity_w: FloatArray
    rotation_w: FloatArray
    angular_velocity_w: FloatArray
    joint_angles: FloatArray
    joint_velocities: FloatArray
    actuator_torques: FloatArray
    contact_forces_w: FloatArray
    is_grounded: FloatArray
    end_effectors_w: FloatArray
    command: FloatArray
    phases: FloatArray
    magnitudes: FloatArray
    retraction: FloatArray
    stumbling: FloatArray
    adhesion: FloatArray
    muscle_tensions: FloatArray
    fictive_velocity_b: FloatArray
    is_unstable: NDArray[np.bool_]

    @property
    def actuation(self) -> FloatArray:
        """What the fly does by command, as a rollout records it: `command`."""
        return self.command

    @property
    def heading_w(self) -> FloatArray:
        """Unit vectors along the thorax, tail to head, (n, 3)."""
        return self.rotation_w[:, :, 0]

    @cached_property
    def yaw(self) -> FloatArray:
        """Heading's angle from +x, counter-clockwise from above, rad in (-pi, pi], (n,)."""
        return np.arctan2(self.rotation_w[:, 1, 0], self.rotation_w[:, 0, 0])

    @property
    def up_b(self) -> FloatArray:
        """The world's up direction in the thorax frame, (n, 3); (0, 0, 1) when level."""
        return self.rotation_w[:, 2, :]


SHOWN: Final = ("phases", "magnitudes", "retraction", "stumbling")
"""Fields of a controller's state that a `FlyState` shows, (6,) each."""


class FlyBatch(Batch):
    """Flies of one scene; parameters are those of `Batch`.

    Attributes
    ----------
    userdata
        Live view of the records that the simulations carry (see `engine.userdata_dtype`),
        (num_sims,).
    controllers
        That of the leg controllers' states, (num_sims,). A write is the state at the next step.
    senses, output
        Those of what the controllers sense and write (`controller.SENSES`, `controller.OUTPUT`),
        (num_sims,).
    gait_logs
        Live view of the logs of the gaits (dtype gait_log.GAIT_LOG), (num_sims,); None where the
        scene has no room for them.
    """

    creature = "fly"
    has_legs = True
    renderer = FlyRenderer
    presets = FLY_PRESETS
    usual_physics = "balanced"
    needless = ("joint_angles",)

    fit = staticmethod(leg_controller)
    build = staticmethod(build_fly_scene)

    def __init__(self, scene: Scene, num_sims: int = 1, num_threads: int = 0) -> None:
        super().__init__(scene, num_sims, num_threads)
        n, model = self.num_sims, scene.model
        self.thorax_body = model.body("Thorax").id
        self.end_effector_bodies = np.array([model.body(name).id for name in END_EFFECTORS])
        self.neutral_angles = PreprogrammedSteps(STEPS_OF_BODY[scene.config.body.name]).default_pose
        self._outer_forces = self._batch.bind("xfrc_applied")
        self._xpos = self._batch.bind("xpos")
        self._xmat = self._batch.bind("xmat")
        self._actuator_force = self._batch.bind("actuator_force")
        self.userdata = self._userdata.view(scene.userdata)[:, 0]
        head = self.userdata["head"]
        self.controllers = self.userdata["controller"]
        self.senses, self.output = head["senses"], head["output"]
        names = self.controllers.dtype.names or ()
        self._legs: dict[str, FloatArray] = {
            name: self.controllers[name] if name in names else np.zeros((n, 6)) for name in SHOWN
        }
        if scene.config.gait_places:
            self.gait_logs = self.userdata["gait_log"][:, 0]
        self._start_pose = start_pose(scene.config.body)
        self._spawn_offset = spawn_offset(scene.config.body)

    def start(self, ids: Ids, episodes: Sequence[Any]) -> None:
        """Put flies at rest in the stretch pose where episodes start; the others are not touched.

        An episode's place is the point from which `bodies.spawn_offset` leads to the thorax, as in
        the published packages.

        Raises
        ------
        ValueError
            If commands are to come with latency, for which the scene has no queue.
        """
        config, head = self.scene.config, self.userdata["head"]
        latencies = [
            round(episode.randomisation.drive_latency / config.physics.timestep)
            for episode in episodes
        ]
        if any(latencies) and not config.queue_places:
            raise ValueError(
                f"queue_places is 0; it must be > 0 for a latency of {max(latencies)} time steps"
            )
        self._clear(ids)
        yaws = np.array([episode.spawn_yaw for episode in episodes])
        cos, sin = np.cos(yaws), np.sin(yaws)
        x, y, z = self._spawn_offset
        offsets = np.stack([cos * x - sin * y, sin * x + cos * y, np.full(len(ids), z)], axis=1)
        self._qpos[ids, :3] = [episode.spawn_position_w for episode in episodes] + offsets
        self._qpos[ids, 3] = np.cos(yaws / 2)
        self._qpos[ids, 4:6] = 0.0
        self._qpos[ids, 6] = np.sin(yaws / 2)
        self._qpos[np.ix_(ids, self.scene.joint_qpos)] = self._start_pose
        for sim, episode in zip(ids, episodes, strict=True):
            self.controllers[sim] = config.controller.initial_state(
                episode.seed, episode.init_phases, episode.init_magnitudes
            )
        self.output["angles"][ids] = self.neutral_angles
        self.output["adhesion"][ids] = 1.0
        head["last_time"][ids] = -1.0
        head["clock"]["latency"][ids] = latencies
        self._forward(ids)

    def set_command(self, command: ArrayLike, ids: Ids | slice = slice(None)) -> None:
        """Set the controllers' command, (n, k), from the next physics step on.

        For most it is the descending drive (left, right). With latency, it sets out for the
        leg controllers then.
        """
        self.userdata["command"][ids] = command

    def push(
        self,
        force_w: NDArray[np.float64],
        moment: NDArray[np.float64],
        ids: Ids | slice = slice(None),
    ) -> None:
        """Push and turn thoraxes from the next physics step on, until the next call.

        Parameters
        ----------
        force_w
            Horizontal, at the thorax's centre of mass, µN, (n, 2).
        moment
            About the vertical, to the left, µN·mm, (n,).
        ids
            Simulations.
        """
        self._outer_forces[ids, self.thorax_body, :2] = force_w
        self._outer_forces[ids, self.thorax_body, 5] = moment

    def state(self) -> FlyState:
        """Copy what the simulations look like now."""
        scene = self.scene
        rotation_w = self._xmat[:, self.thorax_body].reshape(-1, 3, 3).copy()
        return FlyState(
            time=self._time.copy(),
            position_w=self._qpos[:, :3].copy(),
            velocity_w=self._qvel[:, :3].copy(),
            rotation_w=rotation_w,
            angular_velocity_w=(rotation_w @ self._qvel[:, 3:6, None])[:, :, 0],
            joint_angles=self._qpos[:, scene.joint_qpos],
            joint_velocities=self._qvel[:, scene.joint_dofs],
            # before its first step, a simulation has those of another that ran in the same thread
            actuator_torques=np.where(self._time[:, None] > 0.0, self._actuator_force[:, :42], 0.0),
            contact_forces_w=self.senses["contact_forces_w"].copy(),
            is_grounded=self.userdata["head"]["is_grounded"].copy(),
            end_effectors_w=self._xpos[:, self.end_effector_bodies],
            command=self.userdata["command"].copy(),
            **{name: values.copy() for name, values in self._legs.items()},
            adhesion=self.output["adhesion"].copy(),
            muscle_tensions=self.userdata["tensions"].copy(),
            fictive_velocity_b=self._fictive_velocity(rotation_w),
            is_unstable=self._is_unstable.copy(),
        )

    def _fictive_velocity(self, rotation_w: NDArray[np.float64]) -> NDArray[np.float64]:
        """How the ball turns back under flies, see `FlyState.fictive_velocity_b`."""
        velocity = np.zeros((self.num_sims, 3))
        ball, model = self.scene.config.terrain, self.scene.model
        if not isinstance(ball, Ball):
            return velocity
        dofs = model.joint(BALL).dofadr[0] + np.arange(3)
        ball_w = self._xmat[:, model.body(BALL).id].reshape(-1, 3, 3)
        x, y, z = (ball_w @ self._qvel[:, dofs, None])[:, :, 0].T
        cos, sin = rotation_w[:, 0, 0], rotation_w[:, 1, 0]
        # the top of the ball moves along (y, -x) times its radius
        velocity[:, 0] = -ball.radius * (cos * y - sin * x)
        velocity[:, 1] = ball.radius * (cos * x + sin * y)
        velocity[:, 2] = -z
        return velocity

    def leg_states(self, sim: int) -> dict[str, NDArray[np.bool_]]:
        """Copy what the legs of simulation `sim` do, (6,) each, by the names of `LEG_COLOURS`."""
        return {
            "grips": self.output["adhesion"][sim] != 0.0,
            "retracts": self._legs["retraction"][sim] > 0.0,
            "stumbles": self._legs["stumbling"][sim] > 0.0,
        }

    def rows_after(
        self, other: "FlyBatch", controller: np.void, kept: Sequence[str] = ()
    ) -> NDArray[np.float64]:
        """Integration state with which this batch goes on from another of the same body.

        Parameters
        ----------
        other
            Of the same body on the same ground, with as many simulations; its controller may be
            another.
        controller
            The state that every controller starts with.
        kept
            Fields of the other controllers' states that are taken over instead.
        """
        own = np.zeros(self.num_sims, dtype=self.scene.userdata)
        for name in own.dtype.names or ():
            own[name] = controller if name == "controller" else other.userdata[name]
        for name in kept:
            own["controller"][name] = other.controllers[name]
        # MuJoCo's integration state ends with the userdata
        physics = other.integration_state()[:, : -other.scene.userdata.itemsize // 8]
        return np.concatenate([physics, own.view(np.float64).reshape(self.num_sims, -1)], axis=1)

    def gait_samples(self, sim: int, first: int) -> NDArray[np.uint32]:
        """Copy a simulation's samples of its gait from number `first` to the latest.

        Raises
        ------
        ValueError
            If some of them are not kept any more, or the scene has no room for any.
        """
        if self.gait_logs is None:
            raise ValueError("gait_places is 0; it must be > 0 to log the gait")
        end, places = int(self.gait_logs["num_samples"][sim]), self.scene.config.gait_places
        if end - first > places:
            raise ValueError(f"first is {first}; of {end} samples, the last {places} are kept")
        kept = self.userdata["gait_samples"][sim, np.arange(first, end) % places]
        return np.asarray(kept, dtype=np.uint32)
