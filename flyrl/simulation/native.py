"""The native callbacks that MuJoCo calls at every physics step, without Python.

Models without the mark of `engine` are left alone (the callback is global to the process).

Two callbacks share the work. At the control stage the leg controller advances, once per simulated
time, from the contact forces of the previous step and the kinematics of this one, and writes the
servo targets and adhesion. At the acceleration stage of the sensors the contact forces of this step
are summed per segment and kept for the next.

The controller's kernel is called by its address, which the model carries beside a number that only
this process knows: a model from elsewhere, whose address leads nowhere here, is left alone.
"""

import ctypes
from typing import Any, Final

import mujoco
from llvmlite import binding, ir
from numba import carray, types  # type: ignore[attr-defined]
from numba.extending import intrinsic

from flyrl.controllers.compilation import (
    as_float64,
    kernel,
    native_callback,
    pointer_cast,
    record_cast,
)
from flyrl.controllers.controller import (
    NUM_JOINTS,
    NUM_LEGS,
    advance_command,
)
from flyrl.controllers.gait_log import GAIT_LOG, grounded_legs, log_gait
from flyrl.muscles.muscle import move_by_muscles
from flyrl.simulation.engine import (
    ENGINE,
    ENGINE_SIZE,
    HEAD,
    MAGIC,
    NUM_MUSCLES,
    NUM_SENSED_SEGMENTS,
    PROCESS,
    bytes_before,
)

_as_int64 = pointer_cast(types.int64)
_as_int32 = pointer_cast(types.int32)
_as_engine = record_cast(ENGINE)
_as_head = record_cast(HEAD)
_as_gait_log = record_cast(GAIT_LOG)

_SYMBOL: Final = "flyrl_process"
_process = ctypes.c_double(PROCESS)
binding.add_symbol(_SYMBOL, ctypes.addressof(_process))


@intrinsic
def _this_process(_typing_context):  # type: ignore[no-untyped-def]
    """`PROCESS`, which compiled code that comes from the disk's cache looks up by a symbol."""

    def codegen(_context, builder, _signature, _args):  # type: ignore[no-untyped-def]
        number = builder.module.globals.get(_SYMBOL)
        if number is None:
            number = ir.GlobalVariable(builder.module, ir.DoubleType(), _SYMBOL)
        return builder.load(number)

    return types.float64(), codegen


@intrinsic
def _call(_typing_context, _address, _parameters, _state, _senses, _command, _output):  # type: ignore[no-untyped-def]
    """Call the C function at an address with five addresses."""

    def codegen(_context, builder, _signature, args):  # type: ignore[no-untyped-def]
        address = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [address] * 5)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return _context.get_dummy_value()

    return types.void(*6 * (types.int64,)), codegen


@kernel
def _int64(address):  # type: ignore[no-untyped-def]
    return carray(_as_int64(address), (1,))[0]


@kernel
def _int32(address):  # type: ignore[no-untyped-def]
    return carray(_as_int32(address), (1,))[0]


@kernel
def _floats(address, size):  # type: ignore[no-untyped-def]
    """So many float64 at an address, (size,)."""
    return carray(as_float64(address), (size,))


@kernel
def _engine_address(model, at):  # type: ignore[no-untyped-def]
    """Address of a model's ENGINE record, or 0 where the model is not of this process."""
    if _int64(model + at.nnumericdata) < ENGINE_SIZE:
        return 0
    address = _int64(model + at.numeric_data)
    engine = carray(_as_engine(address), (1,))[0]
    if engine.magic != MAGIC or engine.process != _this_process():  # type: ignore[call-arg]
        return 0
    return address if _int64(model + at.nuserdata) >= engine.userdata_size else 0


# Numba captures a variable of an enclosing function by value and keys its cache on disk on it; so
# the offsets below, unlike constants of this module, may change with MuJoCo. They must be plain
# numbers: a captured kernel has another key in every process, which would compile anew.


def control_callback(at: Any) -> Any:
    """Compile the callback that advances the leg controller.

    `at` is the `engine.Layout`, here and below.
    """
    engine_bytes = ENGINE.itemsize
    senses_at, output_at = map(bytes_before, ("senses", "output"))

    @native_callback(types.void(types.intp, types.intp))
    def control(model, data):  # type: ignore[no-untyped-def]
        address = _engine_address(model, at)
        if address == 0:
            return
        engine = carray(_as_engine(address), (1,))[0]
        userdata = _int64(data + at.userdata)
        head = carray(_as_head(userdata), (1,))[0]
        output = head.output
        time = _floats(data + at.time, 1)[0]
        # mj_forward at the same time must not advance the controller a second time
        if time != head.last_time:
            head.last_time = time
            size = int(engine.command_size)
            arrived = userdata + 8 * int(engine.arrived_at)
            queue = as_float64(userdata + 8 * int(engine.queue_at))
            advance_command(
                head.clock,
                _floats(userdata + 8 * int(engine.command_at), size),
                _floats(arrived, size),
                carray(queue, (int(engine.queue_places), 1 + size)),
            )
            _sense(engine, head.senses, data, at)
            _call(  # type: ignore[call-arg]
                int(engine.kernel),
                address + engine_bytes,
                userdata + 8 * int(engine.controller_at),
                userdata + senses_at,
                arrived,
                userdata + output_at,
            )
        ctrl = _floats(_int64(data + at.ctrl), NUM_JOINTS + NUM_LEGS)
        if engine.num_neurons != 0.0:
            muscles = address + 8 * int(engine.muscles_at)
            strengths = muscles + 8 * NUM_JOINTS
            move_by_muscles(
                _floats(muscles, NUM_JOINTS),
                carray(as_float64(strengths), (NUM_JOINTS, 2)),
                _floats(strengths + 8 * NUM_MUSCLES, int(engine.num_neurons)),
                _floats(_int64(data + at.actuator_length), NUM_JOINTS),
                output.angles,
                carray(as_float64(userdata + 8 * int(engine.tensions_at)), (NUM_JOINTS, 2)),
                ctrl,
            )
        else:
            for joint in range(NUM_JOINTS):
                ctrl[joint] = output.angles[joint]
        for leg in range(NUM_LEGS):
            ctrl[NUM_JOINTS + leg] = output.adhesion[leg]

    return control


@kernel
def _sense(engine, senses, data, at):  # type: ignore[no-untyped-def]
    """Write what a controller senses, but for the contact forces, which the sensors sum up."""
    angles = _floats(_int64(data + at.actuator_length), NUM_JOINTS)
    velocities = _floats(_int64(data + at.actuator_velocity), NUM_JOINTS)
    thorax = int(engine.thorax_body)
    rotation = carray(as_float64(_int64(data + at.xmat) + 72 * thorax), (3, 3))
    for axis in range(3):
        senses.heading_w[axis] = rotation[axis, 0]
    senses.thorax_z = _floats(_int64(data + at.xpos) + 24 * thorax, 3)[2]
    _sense_tips(engine, senses.end_effectors_w, _int64(data + at.xpos))
    for leg in range(NUM_LEGS):
        # a leg that is not there is in no hole
        is_missing = engine.is_missing[leg] != 0.0
        senses.end_effector_z[leg] = (
            senses.thorax_z if is_missing else senses.end_effectors_w[leg, 2]
        )
    for joint in range(NUM_JOINTS):
        senses.joint_angles[joint] = angles[joint]
        senses.joint_velocities[joint] = velocities[joint]


@kernel
def _sense_tips(engine, tips_w, positions):  # type: ignore[no-untyped-def]
    """Write where the legs end, (6, 3)."""
    for leg in range(NUM_LEGS):
        tip = _floats(positions + 24 * int(engine.end_effector_bodies[leg]), 3)
        for axis in range(3):
            tips_w[leg, axis] = tip[axis]


@kernel
def segment_of(engine, body):  # type: ignore[no-untyped-def]
    """Index of a body among the 36 contact segments, or -1."""
    for leg in range(NUM_LEGS):
        segment = body - int(engine.tibia_bodies[leg])
        if 0 <= segment < NUM_SENSED_SEGMENTS:
            return leg * NUM_SENSED_SEGMENTS + segment
    return -1


@kernel
def _add_contact_force(engine, forces_w, model, data, contact, at):  # type: ignore[no-untyped-def]
    """Add the force of the contact at an address to the sums of the segments that it touches.

    Its constraint forces are: along normal and tangents for an elliptic friction cone, along the
    cone's edges, normal ± friction · tangent, for a pyramidal one.
    """
    bodies = _int64(model + at.geom_bodyid)
    segment1 = segment_of(engine, _int32(bodies + 4 * _int32(contact + at.geom1)))
    segment2 = segment_of(engine, _int32(bodies + 4 * _int32(contact + at.geom2)))
    row, dim = _int32(contact + at.efc_address), _int32(contact + at.dim)
    if row < 0 or (segment1 < 0 and segment2 < 0):
        return
    rows = _floats(_int64(data + at.efc_force) + 8 * row, 10)
    frame = carray(as_float64(contact + at.frame), (3, 3))
    friction = _floats(contact + at.friction, 5)
    normal, tangent1, tangent2 = rows[0], 0.0, 0.0
    if dim > 1:
        if engine.is_elliptic != 0.0:
            tangent1, tangent2 = rows[1], rows[2]
        else:
            normal = 0.0
            for edge in range(2 * (dim - 1)):
                normal += rows[edge]
            tangent1 = (rows[0] - rows[1]) * friction[0]
            tangent2 = (rows[2] - rows[3]) * friction[1]
    # the frame's rows are normal and tangents; the force acts on the second geom
    for axis in range(3):
        force = normal * frame[0, axis] + tangent1 * frame[1, axis] + tangent2 * frame[2, axis]
        if segment1 >= 0:
            forces_w[segment1, axis] -= force
        if segment2 >= 0:
            forces_w[segment2, axis] += force


@kernel
def _log_gait(engine, head, userdata, data, at):  # type: ignore[no-untyped-def]
    """Log this step, unless mj_forward comes to it a second time."""
    log = carray(_as_gait_log(userdata + 8 * int(engine.gait_log_at)), (1,))[0]
    time = _floats(data + at.time, 1)[0]
    if log.num_steps > 0.0 and time == log.last_time:
        return
    log.last_time = time
    _sense_tips(engine, head.senses.end_effectors_w, _int64(data + at.xpos))
    log_gait(
        log,
        _floats(userdata + 8 * int(engine.gait_samples_at), int(engine.gait_places)),
        engine,
        head,
        _floats(userdata + 8 * int(engine.retraction_at), NUM_LEGS),
        _floats(userdata + 8 * int(engine.stumbling_at), NUM_LEGS),
        _floats(_int64(data + at.actuator_force), NUM_JOINTS),
        _floats(_int64(data + at.actuator_velocity), NUM_JOINTS),
    )


def sensor_callback(at: Any) -> Any:
    """Compile the callback that sums contact forces per segment."""
    acceleration_stage = int(mujoco.mjtStage.mjSTAGE_ACC)

    @native_callback(types.void(types.intp, types.intp, types.int32))
    def sense_contacts(model, data, stage):  # type: ignore[no-untyped-def]
        if stage != acceleration_stage:
            return
        address = _engine_address(model, at)
        if address == 0:
            return
        engine = carray(_as_engine(address), (1,))[0]
        userdata = _int64(data + at.userdata)
        head = carray(_as_head(userdata), (1,))[0]
        forces_w = head.senses.contact_forces_w
        forces_w[:, :] = 0.0
        contacts = _int64(data + at.contact)
        for i in range(_int32(data + at.ncon)):
            contact = contacts + i * at.contact_size
            _add_contact_force(engine, forces_w, model, data, contact, at)
        grounded_legs(forces_w, head.is_grounded)
        if engine.gait_places != 0.0:
            _log_gait(engine, head, userdata, data, at)
        if engine.senses_contact == 0.0:
            forces_w[:, :] = 0.0
            head.is_grounded[:] = 0.0

    return sense_contacts
