"""A scene: one body on one terrain, driven by one leg controller if it has legs, compiled."""

from __future__ import annotations

import copy
import functools
import importlib
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.bodies.fly import PLANES, FlyConfig
from flyrl.controllers.gait_log import SAMPLING_S
from flyrl.files import file_digest
from flyrl.muscles import AttachedMuscle
from flyrl.simulation.callback import install
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig, gravity_along
from flyrl.terrains import NOWHERE, Flat, Ground, Prop, Terrain, box_colours
from flyrl.terrains.geoms import FLAT_GROUND, FLOOR, GROUP, HEIGHT_FIELD
from flyrl.validation import FloatArray, Within, check_fields


def drop_idle_shapes(spec: mujoco.MjSpec) -> None:
    """Delete the shapes of legs for a kind of ground or prop that the scene does not have."""
    ground = np.bitwise_or.reduce([geom.contype for geom in spec.geoms])
    for shape in list(spec.geoms):
        if shape.conaffinity and not shape.conaffinity & ground:
            spec.delete(shape)


def pair_with_planes(spec: mujoco.MjSpec, friction_across: float | None = None) -> None:
    """Replace contact bits by explicit pairs wherever a leg can touch a plane.

    Every leg is always near a plane, as MuJoCo's search for neighbours sees it: the search costs a
    twentieth of a step and leaves nothing out. Boxes are many and stay with their contact bits.

    Parameters
    ----------
    spec
        With the ground in it.
    friction_across
        See `ContactConfig.plane_friction_across`; MuJoCo aligns the contact of a capsule with a
        plane with the capsule's axis.
    """
    planes = [geom for geom in spec.geoms if geom.contype & PLANES]
    shapes = [geom for geom in spec.geoms if geom.conaffinity & PLANES]
    for plane, shape in itertools.product(planes, shapes):
        sliding, torsional, rolling = shape.friction
        across = sliding if friction_across is None else friction_across
        # the shape's own figures, as its higher priority had it
        spec.add_pair(
            geomname1=plane.name,
            geomname2=shape.name,
            condim=shape.condim,
            friction=(sliding, across, torsional, rolling, rolling),
            solref=shape.solref,
            solimp=shape.solimp,
            margin=shape.margin,
        )
    for plane in planes:
        plane.contype &= ~PLANES
    for shape in shapes:
        shape.conaffinity &= ~PLANES


def batch_class(body: Any) -> Any:
    """Subclass of `simulation.batch.Batch` that a body's config names in `simulated_by`.

    Raises
    ------
    ValueError
        If it is no config of a body.
    """
    name = getattr(body, "simulated_by", None)
    if name is None:
        raise ValueError(f"body must be the config of one, got {body!r}")
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)


@dataclass(frozen=True)
class SceneConfig:
    """What a scene is made of.

    Attributes
    ----------
    body, terrain, controller, physics
        Its parts. The body is a config such as FlyConfig or WormConfig. None takes the body's usual
        controller, which takes the body's recorded steps where it asks for none, and the body's
        usual physics; a body without legs has no controller.
    queue_places
        How many commands may be on their way to the legs at the same time, where these are to come
        with latency.
    gait_places
        How many samples of the legs a simulation keeps, as near 1 ms apart as physics steps allow;
        0 logs no gait.
    props
        What stands or moves on the ground. Those that are not solid are only in what is drawn.

    Raises
    ------
    ValueError
        If two props share a name, the parts do not go with the body, or there are less than 0
        places.
    """

    body: Any = field(default_factory=FlyConfig)
    terrain: Terrain = field(default_factory=Flat)
    controller: Any = None
    physics: PhysicsConfig = None  # type: ignore[assignment]  # it is resolved below
    queue_places: Annotated[int, Within(0, 10**6)] = 0
    gait_places: Annotated[int, Within(0, 10**6)] = 0
    props: tuple[Prop, ...] = ()

    def __post_init__(self) -> None:
        if self.physics is None:
            usual = PHYSICS_PRESETS[self.batch_class.usual_physics]
            object.__setattr__(self, "physics", usual)
        check_fields(self)
        kind = self.batch_class
        if self.controller is not None and not kind.has_legs:
            raise ValueError(
                f"controller of a {kind.creature} must be None, got {self.controller!r}"
            )
        object.__setattr__(self, "controller", kind.fit(self))
        names = [prop.name for prop in self.props]
        if len(set(names)) < len(names):
            raise ValueError(f"props must differ in name, got {', '.join(names)}")

    @property
    def batch_class(self) -> Any:
        """What simulates the body, and says what it is."""
        return batch_class(self.body)

    @property
    def steps_per_gait_sample(self) -> int:
        """Physics steps from one sample of the legs to the next."""
        return max(1, round(SAMPLING_S / self.physics.timestep))

    @property
    def gait_sampling_s(self) -> float:
        """Time from one sample of the legs to the next, s."""
        return self.steps_per_gait_sample * self.physics.timestep


@dataclass(frozen=True)
class Scene:
    """A compiled scene and where the body's joints lie in MuJoCo's arrays.

    Attributes
    ----------
    config
        What it was built from.
    model
        Compiled model; its first custom numeric carries the controller, or the muscles of a body
        without legs (see `engine`). Parts of a fly without joints (head, wings, abdomen) are
        merged into the thorax.
    joint_qpos, joint_dofs
        Addresses of the J actuated joints in qpos and qvel, (J,): of a fly 42, ordered as
        anatomy.JOINTS, of a worm from head to tail.
    userdata
        Type of the record that a simulation of a body with legs carries, see
        `engine.userdata_dtype`; without legs, of each of its numbers.
    muscles
        Of a body without legs, M; muscle i is actuator i.
    """

    config: SceneConfig
    model: mujoco.MjModel
    joint_qpos: np.ndarray
    joint_dofs: np.ndarray
    userdata: np.dtype
    muscles: tuple[AttachedMuscle, ...] = ()


class BodyState(Protocol):
    """A snapshot of n bodies, as the terms of a task read it.

    A dataclass of arrays whose first axis is the simulation.

    Attributes
    ----------
    time
        s since the reset, (n,).
    position_w, velocity_w
        Of the body's middle, mm and mm/s, (n, 3), world frame.
    yaw
        Heading's angle from +x, rad, (n,).
    actuation
        What it does by command, (n, k), as a rollout records it.
    is_unstable
        Whether the simulation blew up since its reset, (n,).
    """

    @property
    def time(self) -> FloatArray: ...  # noqa: D102
    @property
    def position_w(self) -> FloatArray: ...  # noqa: D102
    @property
    def velocity_w(self) -> FloatArray: ...  # noqa: D102
    @property
    def yaw(self) -> FloatArray: ...  # noqa: D102
    @property
    def actuation(self) -> FloatArray: ...  # noqa: D102
    @property
    def is_unstable(self) -> NDArray[np.bool_]: ...  # noqa: D102


def build_scene(config: SceneConfig, visual: bool = False) -> Scene:
    """Compile a scene; one that was compiled lately is copied, which is quicker.

    Parameters
    ----------
    config
        Body, terrain, controller and physics.
    visual
        Whether to include what only a camera sees: the body's meshes, lights, props that are not
        solid, the ground without an end. The physics is the same with and without.
    """
    install()  # somebody else's callback would run while the model compiles
    # a user's image may change under its name
    profile = getattr(config.body, "profile_path", None)
    scene = _compiled(config, visual, profile and file_digest(profile))
    return replace(scene, model=copy.copy(scene.model))


@functools.lru_cache(maxsize=8)
def _compiled(config: SceneConfig, visual: bool, profile_digest: str | None) -> Scene:
    scene: Scene = config.batch_class.build(config, visual)
    return scene


class GroundLayer:
    """Where the ground of a scene lies in its model, and how another one is laid there."""

    def __init__(self, scene: Scene) -> None:
        terrain, model = scene.config.terrain, scene.model
        self._compiled = terrain.compiled()
        self.usual = terrain.draw(terrain.seed)
        ids = {model.geom(i).name: i for i in range(model.ngeom)}
        self._field, self._plane = ids.get(HEIGHT_FIELD), ids.get(FLOOR, ids.get(FLAT_GROUND))
        self._first = ids.get("ground_0", 0)
        boxes = np.arange(self._first, self._first + len(self._compiled.boxes.centres))
        self._groups = [boxes[group] for group in terrain.groups or [slice(None)]]
        self._bodies = [model.body(f"{GROUP}{i}").id for i in range(len(terrain.groups))]
        self.fields = ["geom_pos", "geom_size", "opt.gravity"]
        if self._bodies:
            self.fields += ["body_pos"]
        if (heights := terrain.heights()) is not None:
            self._lowest = float(heights.values.min())
            if scene.config.physics.collision_detection == "native":
                self.fields += ["opt.disableflags"]

    def ids(self, ground: Ground) -> NDArray[np.intp]:
        """Geoms that are the boxes of a ground."""
        return np.empty(0, np.intp) if ground.group is None else self._groups[ground.group]

    def check(self, ground: Ground) -> None:
        """Raise ValueError unless every box lies within the one that was compiled."""
        own, hull, ids = ground.boxes, self._compiled.boxes, self.ids(ground) - self._first
        centres, half_sizes = hull.centres[ids], hull.half_sizes[ids]
        if own.centres.shape != centres.shape:
            raise ValueError(
                f"a ground of {len(own.centres)} boxes was drawn; the terrain's hull() has "
                f"{len(centres)}"
            )
        beyond = np.abs(own.centres - centres) + own.half_sizes - half_sizes
        if beyond.size and beyond.max() > 1e-9:
            box = int(beyond.max(axis=1).argmax())
            raise ValueError(
                f"box {box} of a ground that was drawn lies {beyond.max():g} mm beyond that of the "
                "terrain's hull()"
            )

    def show(self, ground: Ground, model: mujoco.MjModel) -> None:
        """Lay a ground in a model that is drawn; its boxes may have other ids, all as much more."""
        more = model.geom("ground_0").id - self._first if len(self.ids(ground)) else 0
        fields = ("geom_pos", "geom_size", "body_pos")
        self.lay(ground, {name: getattr(model, name) for name in fields}, more)
        if len(ground.boxes.centres):
            model.geom_rgba[self.ids(ground) + more] = box_colours(ground.boxes)

    def lay(self, ground: Ground, fields: Mapping[str, NDArray[Any]], more: int = 0) -> None:
        """Write a ground into fields of a model; what it does without lies far below it."""
        places, ids = fields["geom_pos"], self.ids(ground) + more
        places[ids], fields["geom_size"][ids] = ground.boxes.centres, ground.boxes.half_sizes
        for group, body in enumerate(self._bodies):
            fields["body_pos"][body] = 0.0 if group == ground.group else NOWHERE
        if self._plane is not None:
            places[self._plane, 2] = NOWHERE[2] if ground.floor is None else ground.floor
        if self._field is not None:
            x, y, z = NOWHERE if ground.shift is None else ground.shift
            places[self._field] = (x, y, z + self._lowest)
        if (gravity := fields.get("opt.gravity")) is not None:
            gravity[:] = gravity_along(ground.down)
        if (flags := fields.get("opt.disableflags")) is not None:
            # boxes keep their exact contact where there is no field, see `PhysicsConfig`
            exact = mujoco.mjtDisableBit.mjDSBL_NATIVECCD.value
            flags[...] = flags & ~exact if ground.shift is None else flags | exact
