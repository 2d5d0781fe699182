"""The scene of flies: the body on its ground, with what the control callback needs, compiled."""

import itertools
from dataclasses import replace
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from flyrl.anatomy import CONTACT_SEGMENTS, END_EFFECTORS, JOINTS, LEGS, SENSED_SEGMENTS
from flyrl.bodies.fly import FLIES, FlyConfig, add_trunk, build_fly, servo_stiffness
from flyrl.bodies.table import BodyName
from flyrl.controllers import CONTROLLERS, Controller, Hybrid
from flyrl.controllers.controller import compiled_step
from flyrl.controllers.steps import StepsName
from flyrl.muscles import MotorPool
from flyrl.simulation.callback import compiling, install
from flyrl.simulation.engine import (
    ENGINE,
    ENGINE_SIZE,
    MAGIC,
    NUM_MUSCLES,
    PROCESS,
    place_fields,
    userdata_dtype,
)
from flyrl.simulation.physics import PHYSICS_PRESETS, apply_physics
from flyrl.simulation.scene import Scene, SceneConfig, drop_idle_shapes, pair_with_planes
from flyrl.terrains import add_prop, add_terrain

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


def leg_controller(config: SceneConfig) -> Controller:
    """The leg controller of a scene, by default the hybrid one; it takes the body's steps.

    Raises
    ------
    ValueError
        If it is none, or its recorded step does not go with the body's joint order.
    """
    asked = Hybrid() if config.controller is None else config.controller
    if not isinstance(asked, Controller):
        raise ValueError(f"controller must be a Controller, got {asked!r}")
    controller = fit_controller(asked, config.body)
    expected = STEPS_OF_BODY[config.body.name]
    steps = getattr(controller, "steps", expected)
    if steps != expected:
        raise ValueError(
            f"controller.steps is {steps!r}, recorded for another order of "
            f"coxa joints than body.name {config.body.name!r} has; that body takes "
            f"{expected!r}"
        )
    return controller


def compile_controllers() -> None:
    """Compile the callbacks, and all built-in controllers for every fly, unless that is done."""
    install()
    with compiling():
        for kind, body in itertools.product(CONTROLLERS.values(), FLIES.values()):
            compiled_step(fit_controller(kind(), body), PHYSICS_PRESETS["balanced"].timestep)


def build_fly_scene(config: SceneConfig, visual: bool) -> Scene:
    """Compile a scene; see `build_scene`."""
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
    parameters, muscles = controller.parameters(timestep), pack_leg_muscles(config.body)
    size = ENGINE_SIZE + parameters.nbytes // 8 + muscles.size
    spec.add_numeric(name="flyrl_controller", size=size)
    model = spec.compile()
    # written afterwards: the ids of bodies are the model's
    engine = _engine_record(model)
    with compiling():
        engine["kernel"] = compiled_step(controller, timestep)
    place_fields(engine, userdata)
    engine["timestep"] = timestep
    engine["senses_contact"] = config.body.senses_contact
    engine["is_missing"] = [leg in config.body.missing_legs for leg in LEGS]
    engine["steps_per_gait_sample"] = config.steps_per_gait_sample
    engine["num_neurons"] = max(0, muscles.size - len(JOINTS) - NUM_MUSCLES)
    engine["muscles_at"] = size - muscles.size
    data = engine.tobytes() + parameters.tobytes() + muscles.tobytes()
    model.numeric_data[:size] = np.frombuffer(data)
    joints = [model.joint(name) for name in JOINTS]
    return Scene(
        config=config,
        model=model,
        joint_qpos=np.array([joint.qposadr[0] for joint in joints]),
        joint_dofs=np.array([joint.dofadr[0] for joint in joints]),
        userdata=userdata,
    )


def _engine_record(model: mujoco.MjModel) -> np.void:
    engine: np.void = np.zeros(1, ENGINE)[0]
    engine["magic"], engine["process"] = MAGIC, PROCESS
    engine["is_elliptic"] = model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    engine["thorax_body"] = model.body("Thorax").id
    engine["end_effector_bodies"] = [model.body(name).id for name in END_EFFECTORS]
    segments = np.array([model.body(name).id for name in CONTACT_SEGMENTS])
    engine["tibia_bodies"] = tibias = segments[:: len(SENSED_SEGMENTS)]
    # the callback finds a segment by its distance from the leg's tibia
    if not np.array_equal(segments, np.add.outer(tibias, np.arange(6)).ravel()):
        raise RuntimeError("the sensed segments of a leg are not consecutive bodies of the model")
    return engine


def pack_leg_muscles(config: FlyConfig) -> NDArray[np.float64]:
    """Parameters of the muscles for the callback; none of a fly without.

    Stiffness of the servos that they stand in for (42,), strengths (84,), two per joint, and the
    recruitment table of the pool that they share (N,).

    Raises
    ------
    FileNotFoundError, ValueError
        If the profile is not one.
    """
    muscles = config.muscles
    if muscles is None:
        return np.empty(0)
    pool = MotorPool.from_image(muscles.profile_path)
    if muscles.order == "reversed":
        pool = MotorPool(pool.forces[::-1])
    factors = {"L": muscles.left, "R": muscles.right}
    sides = np.array([factors[joint.removeprefix("joint_")[0]] for joint in JOINTS])
    strengths = np.repeat(muscles.strength * sides, 2)
    return np.concatenate([servo_stiffness(config), strengths, pool.recruitment])
