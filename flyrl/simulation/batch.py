"""Many bodies of one scene, stepped on MuJoCo's native threads: what is the same for all bodies."""

import os
import weakref
from collections.abc import Sequence
from typing import Any, ClassVar, Final

import mujoco
import numpy as np
from mujoco.batch import Batch as MujocoBatch
from mujoco.batch import SimulationError
from numpy.typing import ArrayLike, NDArray

from flyrl.simulation.callback import install
from flyrl.simulation.randomisation import Randomisation, show_legs, vary
from flyrl.simulation.rendering import BodyRenderer
from flyrl.simulation.scene import GroundLayer, Scene, SceneConfig
from flyrl.terrains import NOWHERE, Ground
from flyrl.validation import whole_number

Ids = NDArray[np.intp]

MOST_SIMS: Final = 100_000
"""A fly takes some 40 kB, so more of them would fill the memory before the first step."""

MOST_THREADS: Final = 1024

_WITH_THREADS: "Final[weakref.WeakSet[MujocoBatch]]" = weakref.WeakSet()
_OF_PARENT: Final[list[MujocoBatch]] = []
"""Batches whose threads stayed behind in a fork: to free one would wait for its threads forever."""

os.register_at_fork(after_in_child=lambda: _OF_PARENT.extend(_WITH_THREADS))


class Batch:
    """`num_sims` bodies of one scene, on its ground and among its props.

    The result does not depend on the number of threads or of other simulations, to the bit. A
    subclass says what a body is: the class attributes below, and the methods `fit`, `build`,
    `start`, `set_command` and `state`. The config of the body names it in `simulated_by`, as
    `module:attribute`.

    Parameters
    ----------
    scene
        Body, terrain and controller, compiled.
    num_sims
        Number of simulations.
    num_threads
        Native threads that share them; 0 takes one per CPU.

    Raises
    ------
    ValueError
        If one of the numbers is out of its range.

    Attributes
    ----------
    creature
        Word for the body.
    has_legs
        Whether a leg controller moves it; only then can it be randomised, and the ground be rough.
    presets, usual_physics
        Names of the physics presets that it can have, and the usual one.
    renderer
        What draws it.
    needless
        Optional fields of an Episode that do not apply to it.
    prop_starts
        Where props start, mm, (num_sims, props, 3); see `set_props`.
    gait_logs
        Logs of how it walks, (num_sims,); None where there are none.
    """

    creature: ClassVar[str]
    has_legs: ClassVar[bool] = False
    presets: ClassVar[Sequence[str]]
    renderer: ClassVar[type[BodyRenderer]]
    usual_physics: ClassVar[str]
    needless: ClassVar[Sequence[str]]

    gait_logs: NDArray[np.void] | None = None

    @classmethod
    def fit(cls, config: SceneConfig) -> Any:
        """The leg controller that a scene has, given the one that is asked for; None without legs.

        Raises
        ------
        ValueError
            If the parts of the scene do not go with the body.
        """
        raise NotImplementedError

    @classmethod
    def build(cls, config: SceneConfig, visual: bool) -> Scene:
        """Compile a scene; see `build_scene`."""
        raise NotImplementedError

    def start(self, ids: Ids, episodes: Sequence[Any]) -> None:
        """Put simulations `ids` (sorted) where episodes (`flyrl.tasks.Episode`) start.

        Raises
        ------
        ValueError
            If an episode asks for what the body cannot do.
        """
        raise NotImplementedError

    def set_command(self, command: ArrayLike, ids: Ids | slice = slice(None)) -> None:
        """Set what moves the body from the next physics step on, (k, size of a command)."""
        raise NotImplementedError

    def state(self) -> Any:
        """Copy what the simulations look like now: a `BodyState`, with fields of its own."""
        raise NotImplementedError

    def __init__(self, scene: Scene, num_sims: int = 1, num_threads: int = 0) -> None:
        self.num_sims = whole_number("num_sims", num_sims, 1, MOST_SIMS)
        whole_number("num_threads", num_threads, 0, MOST_THREADS)
        install()
        self._batch = MujocoBatch(scene.model, self.num_sims, num_threads)
        self._process = os.getpid()
        if self.num_threads > 1:
            _WITH_THREADS.add(self._batch)
        self._qpos = self._batch.bind("qpos")
        self._qvel = self._batch.bind("qvel")
        self._time = self._batch.bind("time")
        self._userdata = self._batch.bind("userdata")
        self._is_unstable = np.zeros(num_sims, dtype=bool)
        self._warned = self.warnings().sum(axis=1)
        self.scene = scene
        self._layer = GroundLayer(scene)
        self._grounds = [self._layer.usual] * self.num_sims
        if scene.config.terrain.random:
            self._of_grounds = {name: self._batch.expand(name) for name in self._layer.fields}
        self._props = scene.config.props
        self.prop_starts = np.tile(np.array(NOWHERE), (self.num_sims, len(self._props), 1))
        self._solid = [i for i, prop in enumerate(self._props) if prop.is_solid]
        self._paths = {i: prop.path for i, prop in enumerate(self._props) if prop.path}
        self._commands = np.zeros((self.num_sims, 0))
        self._mocap_pos = self._batch.bind("mocap_pos")

    @property
    def num_threads(self) -> int:
        """Number of native threads in use."""
        return int(self._batch.nthread)

    def vary(self, ids: Ids, randomisations: Sequence[Randomisation]) -> None:
        """Make flies differ from the scene's own in friction, mass, servos, adhesion and legs.

        It holds until the next command, and leaves the other simulations alone. On random terrain,
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
        vary(self.scene.model, self._batch, ids, randomisations)

    def set_ground(self, ids: Ids, grounds: Sequence[Ground]) -> None:
        """Lay ground under simulations on random terrain, before `start` or `restore`.

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
            self._layer.lay(ground, {name: of[sim, ...] for name, of in self._of_grounds.items()})
            self._grounds[sim] = ground

    def ground(self, sim: int) -> Ground:
        """The ground that a simulation walks on."""
        return self._grounds[sim]

    def set_props(
        self,
        ids: Ids,
        starts: NDArray[np.float64],
        commands: NDArray[np.float64] | None = None,
    ) -> None:
        """Put props where they start, mm, (k, props, 3), after `start` or later.

        Where one moves, it is from now on where it is at the simulation's time; its path takes the
        commands, (k, size), of episodes. None leaves those as they are.
        """
        self.prop_starts[ids] = starts
        if commands is not None:
            if self._commands.shape[1] != commands.shape[1]:
                self._commands = np.zeros((self.num_sims, commands.shape[1]))
            self._commands[ids] = commands
        self._move_props()

    def props(self, time_s: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Where props are at times (n,), s, or now: mm, (n, props, 3), as `SceneConfig.props`."""
        places = self.prop_starts.copy()
        time_s = self._time if time_s is None else time_s
        for i, path in self._paths.items():
            places[:, i] = path(self.prop_starts[:, i], time_s, self._commands)
        return places

    def step(self, num_steps: int = 1, ids: Ids | None = None) -> None:
        """Advance by physics steps, holding the commands and the props.

        A simulation that diverges is marked unstable and keeps a finite state; the others go on.

        Raises
        ------
        RuntimeError
            If it has threads and was made before a fork, in another process; or if MuJoCo's
            callbacks are somebody else's. So do `start` and `restore`.
        """
        self._move_props()
        self._check_process()
        try:
            self._batch.step(ids, num_steps, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        except SimulationError as error:
            self._is_unstable[error.ids] = True
        warned = self.warnings().sum(axis=1)
        self._is_unstable |= warned > self._warned
        self._warned = warned

    def warnings(self) -> NDArray[np.intp]:
        """How often MuJoCo warned of each simulation since its reset, (n, mjNWARNING)."""
        return np.array(self._batch.warning[:, :, 1], dtype=np.intp)

    def integration_state(self) -> NDArray[np.float64]:
        """Everything that determines the future of each simulation, one row each (a copy).

        What differs among the simulations' models does so too: see `ground` and `vary`.
        """
        return np.array(self._batch.state)

    def restore(self, rows: NDArray[np.float64]) -> None:
        """Put back what `integration_state` returned; the models stay as they are."""
        self._batch.state[:] = rows
        self._is_unstable[:] = False
        self._forward()

    def _move_props(self) -> None:
        """Put solid props where they are now."""
        if self._solid:
            self._mocap_pos[:] = self.props()[:, self._solid]

    def copy_into(self, sim: int, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Pose a model of the same body as simulation `sim`, for rendering, and lay its ground.

        A leg that the simulation lacks is hidden.

        The model may have more in it than the batch's (meshes, props that are not solid) as long
        as the joints, the terrain and the props are the same.
        """
        if self.scene.config.terrain.random:
            self._layer.show(self.ground(sim), model)
        show_legs(self._batch, sim, model)
        data.qpos[:] = self._qpos[sim]
        data.qvel[:] = self._qvel[sim]
        data.time = self._time[sim]
        mujoco.mj_kinematics(model, data)
        if self._props:
            data.mocap_pos[:] = self.props()[sim]

    def _clear(self, ids: Ids) -> None:
        """Put simulations back to the model's defaults, which are to be written over, as stable."""
        self._check_process()
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._is_unstable[ids] = False
        self._warned = self.warnings().sum(axis=1)

    def _forward(self, ids: Ids | None = None) -> None:
        """Bring places of bodies up to date with what was written."""
        self._check_process()
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)

    def _check_process(self) -> None:
        """Raise RuntimeError unless simulations can run here and now; put back our callbacks."""
        if self._process != os.getpid() and self.num_threads > 1:
            raise RuntimeError(
                f"the environment was made in process {self._process} with {self.num_threads} "
                f"threads, which are not in this one, {os.getpid()}: make it in the process that "
                "uses it, or with num_threads=1"
            )
        install()
