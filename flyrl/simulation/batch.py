"""Many flies of one scene, stepped on MuJoCo's native threads."""

from collections.abc import Mapping, Sequence
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import spawn_offset, start_pose
from flyrl.simulation.native import Ids, NativeBatch
from flyrl.simulation.randomisation import Randomisation
from flyrl.simulation.scene import Scene
from flyrl.simulation.state import FlyState, LegStates
from flyrl.simulation.variation import Variation
from flyrl.terrains import BALL, HEIGHT_FIELD, NOWHERE, Ball, Ground, box_colours, positions_at

SHOWN: Final = ("phases", "magnitudes", "retraction", "stumbling")
"""Fields of a controller's state that a `FlyState` shows, (6,) each."""


class FlyBatch(NativeBatch):
    """`num_sims` flies of one scene, each a row of MuJoCo's integration state.

    The result does not depend on the number of threads or of other simulations, to the bit.

    Parameters
    ----------
    scene
        Body, terrain and controller, compiled.
    num_sims
        Number of simulations.
    num_threads
        Native threads that share them; 0 takes one per CPU.

    Attributes
    ----------
    userdata
        Live view of the records that the simulations carry (see `callback.userdata_dtype`),
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

    def __init__(self, scene: Scene, num_sims: int = 1, num_threads: int = 0) -> None:
        super().__init__(scene.model, num_sims, num_threads)
        n = self.num_sims
        self.scene = scene
        self._outer_forces = self._batch.bind("xfrc_applied")
        self._xpos = self._batch.bind("xpos")
        self._xmat = self._batch.bind("xmat")
        self._actuator_force = self._batch.bind("actuator_force")
        self.userdata = self._userdata.view(scene.userdata)[:, 0]
        head = self.userdata["head"]
        self.controllers = self.userdata["controller"]
        self.senses, self.output, self._clock = head["senses"], head["output"], head["clock"]
        self._legs = {name: self._of_controller(name, 6) for name in SHOWN}
        names = scene.userdata.names or ()
        self._tensions = self.userdata["tensions"] if "tensions" in names else np.empty((n, 0))
        self.gait_logs: NDArray[np.void] | None = None
        if "gait_log" in names:
            self.gait_logs = self.userdata["gait_log"]
            self._gait_samples = self.userdata["gait_samples"]
        self._layer = _GroundLayer(scene)
        self._grounds = [self._layer.usual] * n
        if scene.config.terrain.random:
            self._of_grounds = {name: self._batch.expand(name) for name in self._layer.fields}
        self._props = scene.config.props
        self._prop_starts = np.tile(np.array(NOWHERE), (n, len(self._props), 1))
        self._solid = [i for i, prop in enumerate(self._props) if prop.is_solid]
        self._mocap_pos = self._batch.bind("mocap_pos")
        self._ball = scene.config.terrain if isinstance(scene.config.terrain, Ball) else None
        self._start_pose = start_pose(scene.config.body)
        self._spawn_offset = spawn_offset(scene.config.body)
        self._variation = Variation(scene.model, self._batch)

    def reset(
        self,
        ids: Ids,
        positions_w: NDArray[np.float64],
        yaws: NDArray[np.float64],
        controllers: Sequence[np.void],
        latency_steps: Sequence[int] | None = None,
    ) -> None:
        """Put flies at rest in the stretch pose; the others are not touched.

        Parameters
        ----------
        ids
            Simulations to reset, sorted, (k,).
        positions_w
            Where the fly is placed, mm, (k, 3): the point from which `bodies.spawn_offset` leads
            to the thorax, as in the published packages.
        yaws
            Heading from +x, rad, (k,).
        controllers
            k leg controller states, from `Controller.initial_state`.
        latency_steps
            k numbers of physics steps from a command to its arrival at the legs; None: 0 each.

        Raises
        ------
        ValueError
            If commands are to come with latency, for which the scene has no queue.
        """
        if len(ids) == 0:
            return
        latencies = [0] * len(ids) if latency_steps is None else latency_steps
        if any(latencies) and not self.scene.config.queue_places:
            raise ValueError(
                f"queue_places is 0; it must be > 0 for a latency of {max(latencies)} time steps"
            )
        self._clear(ids)
        cos, sin = np.cos(yaws), np.sin(yaws)
        x, y, z = self._spawn_offset
        offsets = np.stack([cos * x - sin * y, sin * x + cos * y, np.full(len(ids), z)], axis=1)
        self._qpos[ids, :3] = positions_w + offsets
        self._qpos[ids, 3] = np.cos(yaws / 2)
        self._qpos[ids, 4:6] = 0.0
        self._qpos[ids, 6] = np.sin(yaws / 2)
        self._qpos[np.ix_(ids, self.scene.joint_qpos)] = self._start_pose
        self.controllers[ids] = np.stack(controllers)
        self.output["angles"][ids] = self.scene.neutral_angles
        self.output["adhesion"][ids] = 1.0
        self.userdata["head"]["last_time"][ids] = -1.0
        self._clock["latency"][ids] = latencies
        self._forward(ids)

    def vary(self, ids: Ids, randomisations: Sequence[Randomisation]) -> None:
        """Make flies differ from the scene's own in friction, mass, servos and adhesion.

        It holds until told otherwise, and leaves the other simulations alone. On random terrain,
        set the ground before: with other masses, MuJoCo derives its bounds too. Sensor noise and
        latency are not of the body: the environment adds the one, and the leg controllers' states
        hold the other.

        Parameters
        ----------
        ids
            Simulations, sorted, (k,).
        randomisations
            One each.
        """
        self._check_process()
        self._variation.apply(ids, randomisations)

    def set_ground(self, ids: Ids, grounds: Sequence[Ground]) -> None:
        """Lay ground under simulations on random terrain, before a reset or `restore`.

        Parameters
        ----------
        ids
            Simulations, (k,).
        grounds
            k grounds of the scene's terrain, from `Terrain.draw`.

        Raises
        ------
        ValueError
            If all simulations of the scene share one ground, or a box is not within its `hull`.
        """
        if not self.scene.config.terrain.random:
            raise ValueError(
                f"terrain {self.scene.config.terrain.name!r} has one ground for all simulations; "
                "terrain.random must be true"
            )
        for sim, ground in zip(ids, grounds, strict=True):
            self._layer.check(ground)
            self._layer.lay(ground, {name: of[sim] for name, of in self._of_grounds.items()})
            self._grounds[sim] = ground

    def ground(self, sim: int) -> Ground:
        """The ground that a simulation walks on."""
        return self._grounds[sim]

    def set_props(self, ids: Ids, starts: NDArray[np.float64]) -> None:
        """Put props where they start, mm, (k, props, 3): of simulations that are, or were, reset.

        Where one moves, it is from now on where it is at the simulation's time.
        """
        self._prop_starts[ids] = starts
        self._move_props()

    def props(self) -> NDArray[np.float64]:
        """Where props are, mm, (n, props, 3), ordered as `SceneConfig.props`."""
        return positions_at(self._props, self._prop_starts, self._time)

    def step(self, num_steps: int = 1, ids: Ids | None = None) -> None:
        """Advance by physics steps, holding the commands and the props.

        Raises
        ------
        RuntimeError
            As `NativeBatch.step`.
        """
        self._move_props()
        super().step(num_steps, ids)

    def _move_props(self) -> None:
        """Put solid props where they are now."""
        if self._solid:
            self._mocap_pos[:] = self.props()[:, self._solid]

    def set_command(self, command: NDArray[np.float64], ids: Ids | slice = slice(None)) -> None:
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
        """Push and turn thoraxes from the next physics step on, until told otherwise.

        Parameters
        ----------
        force_w
            Horizontal, at the thorax's centre of mass, µN, (n, 2).
        moment
            About the vertical, to the left, µN·mm, (n,).
        ids
            Simulations.
        """
        self._outer_forces[ids, self.scene.thorax_body, :2] = force_w
        self._outer_forces[ids, self.scene.thorax_body, 5] = moment

    def state(self) -> FlyState:
        """Copy what the simulations look like now."""
        scene, legs = self.scene, self._legs
        rotation_w = self._xmat[:, scene.thorax_body].reshape(-1, 3, 3).copy()
        return FlyState(
            time=self._time.copy(),
            position_w=self._qpos[:, :3].copy(),
            velocity_w=self._qvel[:, :3].copy(),
            rotation_w=rotation_w,
            angular_velocity_w=(rotation_w @ self._qvel[:, 3:6, None])[:, :, 0],
            joint_angles=self._qpos[:, scene.joint_qpos],
            joint_velocities=self._qvel[:, scene.joint_dofs],
            actuator_torques=self._actuator_force[:, :42].copy(),
            contact_forces_w=self.senses["contact_forces_w"].copy(),
            end_effectors_w=self._xpos[:, scene.end_effector_bodies],
            command=self.userdata["command"].copy(),
            phases=legs["phases"].copy(),
            magnitudes=legs["magnitudes"].copy(),
            retraction=legs["retraction"].copy(),
            stumbling=legs["stumbling"].copy(),
            adhesion=self.output["adhesion"].copy(),
            muscle_tensions=self._tensions.copy(),
            fictive_velocity_b=self._fictive_velocity(rotation_w),
            is_unstable=self._is_unstable.copy(),
        )

    def _fictive_velocity(self, rotation_w: NDArray[np.float64]) -> NDArray[np.float64]:
        """How the ball turns back under flies, see `FlyState.fictive_velocity_b`."""
        velocity = np.zeros((self.num_sims, 3))
        if self._ball is None:
            return velocity
        model = self.scene.model
        dofs = model.joint(BALL).dofadr[0] + np.arange(3)
        ball_w = self._xmat[:, model.body(BALL).id].reshape(-1, 3, 3)
        x, y, z = (ball_w @ self._qvel[:, dofs, None])[:, :, 0].T
        cos, sin = rotation_w[:, 0, 0], rotation_w[:, 1, 0]
        # the top of the ball moves along (y, -x) times its radius
        velocity[:, 0] = -self._ball.radius * (cos * y - sin * x)
        velocity[:, 1] = self._ball.radius * (cos * x + sin * y)
        velocity[:, 2] = -z
        return velocity

    def leg_states(self, sim: int) -> LegStates:
        """Copy what the legs of simulation `sim` do, as its controller left them."""
        return LegStates(
            grips=self.output["adhesion"][sim] != 0.0,
            retracts=self._legs["retraction"][sim] > 0.0,
            stumbles=self._legs["stumbling"][sim] > 0.0,
        )

    def _of_controller(self, name: str, size: int) -> NDArray[np.float64]:
        """Live view of a field of the controllers' states, (n, size); zeros where it has none."""
        if name in (self.controllers.dtype.names or ()):
            shown: NDArray[np.float64] = self.controllers[name]
            return shown
        return np.zeros((self.num_sims, size))

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
        theirs = other.userdata
        for name in own.dtype.names or ():
            if name != "controller" and name in (theirs.dtype.names or ()):
                own[name] = theirs[name]
        own["controller"] = controller
        for name in kept:
            own["controller"][name] = theirs["controller"][name]
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
        end, places = int(self.gait_logs["num_samples"][sim]), self._gait_samples.shape[1]
        if end - first > places:
            raise ValueError(f"first is {first}; of {end} samples, the last {places} are kept")
        kept = self._gait_samples[sim, np.arange(first, end) % places]
        return np.asarray(kept, dtype=np.uint32)

    def copy_into(self, sim: int, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Pose a model of the same body as simulation `sim`, for rendering, and lay its ground.

        The model may have more in it than the batch's (meshes, props that are not solid) as long
        as the joints, the terrain and the props are the same.
        """
        if self.scene.config.terrain.random:
            ground = self.ground(sim)
            fields = ("geom_pos", "geom_size")
            self._layer.lay(ground, {name: getattr(model, name) for name in fields})
            if len(ground.boxes.centres):
                model.geom_rgba[self._layer.boxes] = box_colours(ground.boxes)
        super().copy_into(sim, model, data)
        if self._props:
            data.mocap_pos[:] = self.props()[sim]


class _GroundLayer:
    """Where the ground of a scene lies in its model, and how another one is laid there."""

    def __init__(self, scene: Scene) -> None:
        terrain = scene.config.terrain
        self._compiled = terrain.compiled()
        self.usual = terrain.draw(terrain.seed)
        self.boxes = slice(0, 0)
        if count := len(self._compiled.boxes.centres):
            first = scene.model.geom("ground_0").id
            self.boxes = slice(first, first + count)
        self._field: int | None = None
        if (heights := terrain.heights()) is not None:
            self._field = scene.model.geom(HEIGHT_FIELD).id
            self._lowest = float(heights.values.min())
        self.fields = ("geom_pos", "geom_size", "opt.gravity")

    def check(self, ground: Ground) -> None:
        """Raise ValueError unless every box lies within the one that was compiled."""
        own, hull = ground.boxes, self._compiled.boxes
        if own.centres.shape != hull.centres.shape:
            raise ValueError(
                f"a ground of {len(own.centres)} boxes was drawn; the terrain's hull() has "
                f"{len(hull.centres)}"
            )
        beyond = np.abs(own.centres - hull.centres) + own.half_sizes - hull.half_sizes
        if beyond.size and beyond.max() > 1e-9:
            box = int(beyond.max(axis=1).argmax())
            raise ValueError(
                f"box {box} of a ground that was drawn lies {beyond.max():g} mm beyond that of the "
                "terrain's hull()"
            )

    def lay(self, ground: Ground, fields: Mapping[str, NDArray[np.float64]]) -> None:
        """Write a ground into fields of a model."""
        fields["geom_pos"][self.boxes] = ground.boxes.centres
        fields["geom_size"][self.boxes] = ground.boxes.half_sizes
        if self._field is not None:
            x, y, z = ground.shift
            fields["geom_pos"][self._field] = (x, y, z + self._lowest)
        if (gravity := fields.get("opt.gravity")) is not None:
            gravity[:] = np.linalg.norm(gravity) * np.array(ground.down)
