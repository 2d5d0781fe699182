"""A scene: one body on one terrain, driven by one leg controller, as a compiled model."""

import copy
import functools
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import mujoco
import numpy as np

from flyrl.anatomy import CONTACT_SEGMENTS, END_EFFECTORS, JOINTS, LEGS, SENSED_SEGMENTS
from flyrl.bodies.fly import FlyConfig, add_trunk, build_fly
from flyrl.bodies.table import BodyName
from flyrl.controllers import Controller, Hybrid, PreprogrammedSteps
from flyrl.controllers.controller import compiled_step
from flyrl.controllers.gait_log import SAMPLING_S
from flyrl.controllers.steps import StepsName
from flyrl.files import file_digest
from flyrl.simulation.callback import (
    ENGINE,
    MAGIC,
    NUM_MUSCLES,
    PROCESS,
    announced,
    install,
    one_process_at_a_time,
    pack_model_data,
    place_fields,
    userdata_dtype,
)
from flyrl.simulation.muscles import pack_leg_muscles
from flyrl.simulation.pairs import drop_idle_shapes, pair_with_planes
from flyrl.simulation.physics import PHYSICS_PRESETS, PhysicsConfig, apply_physics
from flyrl.terrains import Flat, Prop, Terrain, add_prop, add_terrain
from flyrl.validation import Within, check_fields

STEPS_OF_BODY: Final[dict[BodyName, StepsName]] = {
    "current": "untethered",
    "classic": "tethered",
}
"""The recorded step that was made for the order of a body's coxa joints."""


def fit_controller(controller: Controller, body: FlyConfig) -> Controller:
    """Let a controller take the body's recorded steps, unless it asks for others or takes none."""
    if getattr(controller, "steps", "") is None:
        return replace(controller, **{"steps": STEPS_OF_BODY[body.name]})
    return controller


@dataclass(frozen=True)
class SceneConfig:
    """What a scene is made of.

    Attributes
    ----------
    body, terrain, controller, physics
        Its parts; a controller takes the body's recorded steps where it asks for none.
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
        If two props share a name, the controller's recorded step does not go with the body's joint
        order, or there are less than 0 places.
    """

    body: FlyConfig = field(default_factory=FlyConfig)
    terrain: Terrain = field(default_factory=Flat)
    controller: Controller = field(default_factory=Hybrid)
    physics: PhysicsConfig = PHYSICS_PRESETS["balanced"]
    queue_places: Annotated[int, Within(0, 10**6)] = 0
    gait_places: Annotated[int, Within(0, 10**6)] = 0
    props: tuple[Prop, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "controller", fit_controller(self.controller, self.body))
        names = [prop.name for prop in self.props]
        if len(set(names)) < len(names):
            raise ValueError(f"props must differ in name, got {', '.join(names)}")
        expected = STEPS_OF_BODY[self.body.name]
        steps = getattr(self.controller, "steps", expected)
        if steps != expected:
            raise ValueError(
                f"controller.steps is {steps!r}, recorded for another order of "
                f"coxa joints than body.name {self.body.name!r} has; that body takes {expected!r}"
            )

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
    """A compiled scene and where its parts lie in MuJoCo's arrays.

    Attributes
    ----------
    model
        Compiled model; its first custom numeric carries the controller (see `callback`). Bodies
        without joints (head, wings, abdomen) are merged into the thorax.
    joint_qpos, joint_dofs
        Addresses of the 42 actuated joints in qpos and qvel, (42,), ordered as anatomy.JOINTS.
    thorax_body, end_effector_bodies
        Body ids; the latter (6,), ordered as anatomy.LEGS.
    userdata
        Type of the record that a simulation carries, see `callback.userdata_dtype`.
    neutral_angles
        Target angles before the controller's first step, rad, (42,).
    """

    config: SceneConfig
    model: mujoco.MjModel
    joint_qpos: np.ndarray
    joint_dofs: np.ndarray
    thorax_body: int
    end_effector_bodies: np.ndarray
    userdata: np.dtype
    neutral_angles: np.ndarray


def build_scene(config: SceneConfig, visual: bool = False) -> Scene:
    """Compile a scene; one that was compiled lately is copied, which is quicker.

    Parameters
    ----------
    config
        Body, terrain, controller and physics.
    visual
        Whether to include what only a camera sees: the body's meshes, lights, props that are not
        solid. The physics is the same with and without.
    """
    install()  # somebody else's callback would run while the model compiles
    profile = config.body.muscles and config.body.muscles.profile_path
    # a user's image may change under its name
    scene = _compiled(config, visual, profile and file_digest(profile))
    return replace(scene, model=copy.copy(scene.model))


@functools.lru_cache(maxsize=8)
def _compiled(config: SceneConfig, visual: bool, profile_digest: str | None) -> Scene:
    spec = build_fly(config.body, contact=config.physics.contact, visual=visual)
    add_terrain(spec, config.terrain)
    for prop in config.props:
        if visual or prop.is_solid:
            add_prop(spec, prop)
    if any(prop.is_solid for prop in config.props):
        add_trunk(spec, config.physics.contact)
    drop_idle_shapes(spec)
    pair_with_planes(spec, config.physics.contact.plane_friction_across)
    apply_physics(spec, config.physics, config.terrain)
    spec.compiler.fusestatic = True
    controller, timestep = config.controller, config.physics.timestep
    userdata = userdata_dtype(
        controller.initial_state().dtype,
        len(controller.command.names),
        config.queue_places,
        config.gait_places,
        config.body.muscles is not None,
    )
    spec.nuserdata = userdata.itemsize // 8
    # a user sensor makes MuJoCo call the sensor callback
    spec.add_sensor(
        name="contact_forces",
        type=mujoco.mjtSensor.mjSENS_USER,
        datatype=mujoco.mjtDataType.mjDATATYPE_REAL,
        needstage=mujoco.mjtStage.mjSTAGE_ACC,
        dim=1,
    )
    # compiled twice: the controller's record needs the body ids that only a model has
    engine = _engine_record(spec.compile())
    with one_process_at_a_time(), announced():
        engine["kernel"] = compiled_step(controller, timestep)
    place_fields(engine, userdata)
    engine["timestep"] = timestep
    engine["senses_contact"] = config.body.senses_contact
    engine["is_missing"] = [leg in config.body.missing_legs for leg in LEGS]
    engine["steps_per_gait_sample"] = config.steps_per_gait_sample
    muscles = pack_leg_muscles(config.body)
    engine["num_neurons"] = max(0, muscles.size - len(JOINTS) - NUM_MUSCLES)
    model_data = pack_model_data(engine, controller.parameters(timestep), muscles)
    spec.add_numeric(name="flyrl_controller", data=model_data, size=model_data.size)
    model = spec.compile()
    joints = [model.joint(name) for name in JOINTS]
    return Scene(
        config=config,
        model=model,
        joint_qpos=np.array([joint.qposadr[0] for joint in joints]),
        joint_dofs=np.array([joint.dofadr[0] for joint in joints]),
        thorax_body=model.body("Thorax").id,
        end_effector_bodies=np.array([model.body(name).id for name in END_EFFECTORS]),
        userdata=userdata,
        neutral_angles=PreprogrammedSteps(STEPS_OF_BODY[config.body.name]).default_pose,
    )


def _engine_record(model: mujoco.MjModel) -> np.void:
    engine: np.void = np.zeros(1, ENGINE)[0]
    engine["magic"], engine["process"] = MAGIC, PROCESS
    engine["is_elliptic"] = model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    engine["thorax_body"] = model.body("Thorax").id
    engine["end_effector_bodies"] = [model.body(name).id for name in END_EFFECTORS]
    segments = np.array([model.body(name).id for name in CONTACT_SEGMENTS])
    tibias = segments.reshape(len(LEGS), len(SENSED_SEGMENTS))[:, 0]
    # the callback finds a segment by its distance from the leg's tibia
    if not np.array_equal(segments.reshape(len(LEGS), -1), tibias[:, None] + np.arange(6)):
        raise RuntimeError("the sensed segments of a leg are not consecutive bodies of the model")
    engine["tibia_bodies"] = tibias
    return engine
