"""Many bodies of one scene, stepped on MuJoCo's native threads: what is the same for all bodies."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flyrl.simulation.native import Ids, NativeBatch
from flyrl.simulation.randomisation import Randomisation
from flyrl.simulation.rendering import BodyRenderer
from flyrl.simulation.scene import Scene, SceneConfig
from flyrl.simulation.variation import Variation
from flyrl.terrains import HEIGHT_FIELD, NOWHERE, Ground, box_colours, positions_at


class Batch(NativeBatch):
    """`num_sims` bodies of one scene, on its ground and among its props.

    A subclass says what a body is: the class attributes below, and the methods `fit`, `build`,
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
        super().__init__(scene.model, num_sims, num_threads)
        self.scene = scene
        self._layer = _GroundLayer(scene)
        self._grounds = [self._layer.usual] * self.num_sims
        if scene.config.terrain.random:
            self._of_grounds = {name: self._batch.expand(name) for name in self._layer.fields}
        self._props = scene.config.props
        self.prop_starts = np.tile(np.array(NOWHERE), (self.num_sims, len(self._props), 1))
        self._solid = [i for i, prop in enumerate(self._props) if prop.is_solid]
        self._mocap_pos = self._batch.bind("mocap_pos")
        self._variation = Variation(scene.model, self._batch)

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
        self.prop_starts[ids] = starts
        self._move_props()

    def props(self) -> NDArray[np.float64]:
        """Where props are, mm, (n, props, 3), ordered as `SceneConfig.props`."""
        return positions_at(self._props, self.prop_starts, self._time)

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
