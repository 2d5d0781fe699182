"""The native control callback: MuJoCo calls it at every physics step, without Python.

A model that flyrl built carries everything the callback needs: `ENGINE`, the controller's
parameters and its step splines in the model's first custom numeric; the controller's state in
`mjData.userdata`, with the drives that are on their way to it, which is part of MuJoCo's
integration state. So saving, restoring and replaying a simulation includes its controller,
exactly. Models without that mark are left alone (the callback is global to the process).

Two callbacks share the work. At the control stage the leg controller advances, once per
simulated time, from the contact forces of the previous step and the kinematics of this one, and
writes the servo targets and adhesion. At the acceleration stage of the sensors the contact
forces of this step are summed per segment and kept for the next.

Other creatures with muscles have a mark of their own. Their models carry the muscles, and their
userdata how many neurons are recruited; the control callback writes the tensions and forces that
follow from these, and advances nothing.
"""

import contextlib
import ctypes
import functools
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import mujoco
import numba
import numpy as np
from filelock import lock_descriptor
from numba import carray, types  # type: ignore[attr-defined]
from numba.core.event import Event, Listener, install_listener
from numba.extending import intrinsic

from flyrl.controllers.compilation import kernel, native_callback
from flyrl.controllers.gait_log import GAIT_LOG, log_gait
from flyrl.controllers.latency import PLACE_SIZE, advance_drive
from flyrl.controllers.leg_controller import PARAMETERS, STATE, control_step
from flyrl.muscles import Muscle, pack_muscles
from flyrl.muscles.kernels import activate, move_by_muscles
from flyrl.simulation.layout import Layout, layout

MAGIC = 20_261_121.0
"""Marks a model as flyrl's; a number that no other model's first numeric begins with."""

CREATURE_MAGIC = 20_261_122.0
"""Marks a model of another creature, which has muscles and no leg controller."""

CREATURE_HEAD = 3
"""How many numbers a creature's model carries before its muscles' arrays."""

NUM_LEGS = 6
NUM_SENSED_SEGMENTS = 6
NUM_SERVOS = 42
NUM_MUSCLES = 2 * NUM_SERVOS

ENGINE = np.dtype(
    [
        ("magic", "f8"),
        ("is_elliptic", "f8"),
        ("thorax_body", "f8"),
        ("num_intervals", "f8"),
        ("num_neurons", "f8"),
        ("queue_places", "f8"),
        ("tensions_at", "f8"),
        ("gait_log_at", "f8"),
        ("gait_places", "f8"),
        ("steps_per_gait_sample", "f8"),
        ("senses_contact", "f8"),
        ("is_missing", "f8", (NUM_LEGS,)),
        ("tibia_bodies", "f8", (NUM_LEGS,)),
        ("end_effector_bodies", "f8", (NUM_LEGS,)),
    ],
    align=True,
)
"""Where the callback finds the body in the model; every field a float64."""

SCRATCH = np.dtype(
    [
        ("end_effector_z", "f8", (NUM_LEGS,)),
        ("heading", "f8", (3,)),
        ("tips_w", "f8", (NUM_LEGS, 3)),
        ("grounded", "f8", (NUM_LEGS,)),
    ],
    align=True,
)

ENGINE_SIZE = ENGINE.itemsize // 8
PARAMETERS_SIZE = PARAMETERS.itemsize // 8
STATE_SIZE = STATE.itemsize // 8
GAIT_LOG_BYTES = GAIT_LOG.itemsize
GAIT_LOG_SIZE = GAIT_LOG_BYTES // 8
USERDATA_SIZE = STATE_SIZE + SCRATCH.itemsize // 8
"""Without the queue of drives on their way and the log of the gait, which come last."""


def userdata_size(queue_places: int, gait_places: int = 0, has_muscles: bool = False) -> int:
    """How many numbers a simulation carries for the callback; without places, there is no log."""
    end = gait_log_at(queue_places, has_muscles)
    return end + (GAIT_LOG_SIZE + gait_places if gait_places else 0)


def tensions_at(queue_places: int) -> int:
    """Where in the userdata the muscles' tensions are, if the body has muscles."""
    return USERDATA_SIZE + PLACE_SIZE * queue_places


def gait_log_at(queue_places: int, has_muscles: bool = False) -> int:
    """Where in the userdata the log of the gait is; its samples follow it."""
    return tensions_at(queue_places) + (NUM_MUSCLES if has_muscles else 0)


def pack_model_data(
    engine: np.void, parameters: np.void, coefficients: np.ndarray, muscles: np.ndarray
) -> np.ndarray:
    """Concatenate what a model carries for the callback into one float64 array.

    The last is what `muscles.pack_leg_muscles` gives.
    """
    return np.concatenate(
        [
            np.frombuffer(engine.tobytes()),
            np.frombuffer(parameters.tobytes()),
            np.ascontiguousarray(coefficients, dtype=np.float64).ravel(),
            muscles,
        ]
    )


def creature_userdata_size(num_muscles: int) -> int:
    """How many numbers a creature carries: its muscles' neurons, then their tensions."""
    return 2 * num_muscles


def pack_creature_data(muscles: Sequence[Muscle]) -> np.ndarray:
    """Concatenate what a creature's model carries for the callback into one float64 array.

    The mark, the number M of muscles, that of the entries of their tables, and `PackedMuscles`:
    starts (M + 1), strengths (M), recruitment tables. Actuator i is muscle i.
    """
    packed = pack_muscles(muscles)
    head = (CREATURE_MAGIC, len(packed.strengths), len(packed.recruitment))
    return np.concatenate([head, packed.starts, packed.strengths, packed.recruitment])


def _pointer_cast(element: types.Type) -> Any:
    """Make a Numba intrinsic that reads an integer address as a pointer to `element`."""

    @intrinsic
    def cast(_typing_context, _address):  # type: ignore[no-untyped-def]
        signature = types.CPointer(element)(types.int64)  # type: ignore[no-untyped-call]

        def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


_as_int64 = _pointer_cast(types.int64)
_as_int32 = _pointer_cast(types.int32)
_as_float64 = _pointer_cast(types.float64)
_as_engine = _pointer_cast(numba.from_dtype(ENGINE))
_as_parameters = _pointer_cast(numba.from_dtype(PARAMETERS))
_as_state = _pointer_cast(numba.from_dtype(STATE))
_as_scratch = _pointer_cast(numba.from_dtype(SCRATCH))
_as_gait_log = _pointer_cast(numba.from_dtype(GAIT_LOG))


@kernel
def _int64(address):  # type: ignore[no-untyped-def]
    return carray(_as_int64(address), (1,))[0]


@kernel
def _int32(address):  # type: ignore[no-untyped-def]
    return carray(_as_int32(address), (1,))[0]


@kernel
def _engine_address(model, userdata_size_at, numeric_size_at, numeric_at):  # type: ignore[no-untyped-def]
    """Address of a model's ENGINE record, or 0 where the model is not flyrl's."""
    if (
        _int64(model + userdata_size_at) < USERDATA_SIZE
        or _int64(model + numeric_size_at) < ENGINE_SIZE + PARAMETERS_SIZE
    ):
        return 0
    address = _int64(model + numeric_at)
    if carray(_as_float64(address), (1,))[0] != MAGIC:
        return 0
    return address


@kernel
def _creature_address(model, userdata_size_at, numeric_size_at, numeric_at):  # type: ignore[no-untyped-def]
    """Address of what `pack_creature_data` packed, or 0 where the model has none."""
    if _int64(model + numeric_size_at) < CREATURE_HEAD:
        return 0
    address = _int64(model + numeric_at)
    head = carray(_as_float64(address), (CREATURE_HEAD,))
    if head[0] != CREATURE_MAGIC or _int64(model + userdata_size_at) < 2 * int(head[1]):
        return 0
    return address


@kernel
def _move_creature(address, userdata, ctrl):  # type: ignore[no-untyped-def]
    """Write the tensions and forces of a creature's muscles; all are addresses."""
    head = carray(_as_float64(address), (CREATURE_HEAD,))
    muscles, entries = int(head[1]), int(head[2])
    starts = address + 8 * CREATURE_HEAD
    strengths = starts + 8 * (muscles + 1)
    activate(
        carray(_as_float64(strengths + 8 * muscles), (entries,)),
        carray(_as_float64(starts), (muscles + 1,)),
        carray(_as_float64(strengths), (muscles,)),
        carray(_as_float64(userdata), (muscles,)),
        carray(_as_float64(userdata + 8 * muscles), (muscles,)),
        carray(_as_float64(ctrl), (muscles,)),
    )


# Numba captures a variable of an enclosing function by value and keys its cache on disk on it; so
# the offsets below, unlike constants of this module, may change with MuJoCo. They must be plain
# numbers: a captured kernel has another key in every process, which would compile anew.


def _control_callback(found: Layout) -> Any:
    """Compile the callback that advances the leg controller, or moves a creature's muscles."""
    userdata_size_at = found.model["nuserdata"]
    numeric_size_at = found.model["nnumericdata"]
    numeric_at = found.model["numeric_data"]
    time_at = found.data["time"]
    ctrl_at = found.data["ctrl"]
    userdata_at = found.data["userdata"]
    positions_at = found.data["xpos"]
    rotations_at = found.data["xmat"]
    engine_bytes = ENGINE.itemsize
    angles_at = found.data["actuator_length"]
    header_bytes = ENGINE.itemsize + PARAMETERS.itemsize
    state_bytes = STATE.itemsize
    queue_bytes = 8 * USERDATA_SIZE
    place_size = PLACE_SIZE
    spline_bytes = 8 * NUM_LEGS * 7 * 4

    @native_callback(types.void(types.intp, types.intp))
    def control(model, data):  # type: ignore[no-untyped-def]
        address = _engine_address(model, userdata_size_at, numeric_size_at, numeric_at)
        if address == 0:
            creature = _creature_address(model, userdata_size_at, numeric_size_at, numeric_at)
            if creature != 0:
                _move_creature(creature, _int64(data + userdata_at), _int64(data + ctrl_at))
            return
        engine = carray(_as_engine(address), (1,))[0]
        parameters = carray(_as_parameters(address + engine_bytes), (1,))[0]
        userdata = _int64(data + userdata_at)
        state = carray(_as_state(userdata), (1,))[0]
        time = carray(_as_float64(data + time_at), (1,))[0]
        # mj_forward at the same time must not advance the controller a second time
        if time != state.last_time:
            state.last_time = time
            places = int(engine.queue_places)
            advance_drive(state, carray(_as_float64(userdata + queue_bytes), (places, place_size)))
            scratch = carray(_as_scratch(userdata + state_bytes), (1,))[0]
            thorax = int(engine.thorax_body)
            positions = _int64(data + positions_at)
            rotation = carray(_as_float64(_int64(data + rotations_at) + 72 * thorax), (3, 3))
            for axis in range(3):
                scratch.heading[axis] = rotation[axis, 0]
            thorax_z = carray(_as_float64(positions + 24 * thorax), (3,))[2]
            for leg in range(NUM_LEGS):
                body = int(engine.end_effector_bodies[leg])
                tip_z = carray(_as_float64(positions + 24 * body), (3,))[2]
                # a leg that is not there is in no hole
                scratch.end_effector_z[leg] = thorax_z if engine.is_missing[leg] != 0.0 else tip_z
            coefficients = carray(
                _as_float64(address + header_bytes), (NUM_LEGS, int(engine.num_intervals), 7, 4)
            )
            control_step(
                parameters, coefficients, state, thorax_z, scratch.end_effector_z, scratch.heading
            )
        ctrl = carray(_as_float64(_int64(data + ctrl_at)), (NUM_SERVOS + NUM_LEGS,))
        if engine.num_neurons != 0.0:
            muscles = address + header_bytes + spline_bytes * int(engine.num_intervals)
            strengths = muscles + 8 * NUM_SERVOS
            move_by_muscles(
                carray(_as_float64(muscles), (NUM_SERVOS,)),
                carray(_as_float64(strengths), (NUM_SERVOS, 2)),
                carray(_as_float64(strengths + 8 * NUM_MUSCLES), (int(engine.num_neurons),)),
                carray(_as_float64(_int64(data + angles_at)), (NUM_SERVOS,)),
                state.targets,
                carray(_as_float64(userdata + 8 * int(engine.tensions_at)), (NUM_SERVOS, 2)),
                ctrl,
            )
        else:
            for servo in range(NUM_SERVOS):
                ctrl[servo] = state.targets[servo]
        for leg in range(NUM_LEGS):
            ctrl[NUM_SERVOS + leg] = state.adhesion[leg]

    return control


@kernel
def _segment_of(engine, body):  # type: ignore[no-untyped-def]
    """Index of a body among the 36 contact segments, or -1."""
    for leg in range(NUM_LEGS):
        segment = body - int(engine.tibia_bodies[leg])
        if 0 <= segment < NUM_SENSED_SEGMENTS:
            return leg * NUM_SENSED_SEGMENTS + segment
    return -1


@kernel
def _add_contact_force(forces_w, segment1, segment2, frame, rows, friction, dim, is_elliptic):  # type: ignore[no-untyped-def]
    """Add one contact's force to the sums of the segments it touches.

    `rows` are the contact's constraint forces: along normal and tangents for an elliptic friction
    cone, along the cone's edges, normal ± friction · tangent, for a pyramidal one.
    """
    normal, tangent1, tangent2 = rows[0], 0.0, 0.0
    if dim > 1:
        if is_elliptic:
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
def _log_gait(  # type: ignore[no-untyped-def]
    engine, parameters, state, scratch, log_address, time, positions, torques, velocities
):
    """Log this step, unless mj_forward comes to it a second time."""
    log = carray(_as_gait_log(log_address), (1,))[0]
    if log.num_steps > 0.0 and time == log.last_time:
        return
    log.last_time = time
    for leg in range(NUM_LEGS):
        body = int(engine.end_effector_bodies[leg])
        tip = carray(_as_float64(positions + 24 * body), (3,))
        for axis in range(3):
            scratch.tips_w[leg, axis] = tip[axis]
    log_gait(
        log,
        carray(_as_float64(log_address + GAIT_LOG_BYTES), (int(engine.gait_places),)),
        int(engine.steps_per_gait_sample),
        parameters.timestep,
        state,
        scratch.grounded,
        torques,
        velocities,
        scratch.tips_w,
    )


def _sensor_callback(found: Layout) -> Any:
    """Compile the callback that sums contact forces per segment."""
    userdata_size_at = found.model["nuserdata"]
    numeric_size_at = found.model["nnumericdata"]
    numeric_at = found.model["numeric_data"]
    geom_body_at = found.model["geom_bodyid"]
    userdata_at = found.data["userdata"]
    num_contacts_at = found.data["ncon"]
    contacts_at = found.data["contact"]
    constraint_forces_at = found.data["efc_force"]
    contact_size = found.contact_size
    frame_at = found.contact["frame"]
    friction_at = found.contact["friction"]
    dim_at = found.contact["dim"]
    geom1_at = found.contact["geom1"]
    geom2_at = found.contact["geom2"]
    row_at = found.contact["efc_address"]
    time_at = found.data["time"]
    positions_at = found.data["xpos"]
    torques_at = found.data["actuator_force"]
    velocities_at = found.data["actuator_velocity"]
    acceleration_stage = int(mujoco.mjtStage.mjSTAGE_ACC)
    engine_bytes = ENGINE.itemsize
    state_bytes = STATE.itemsize

    @native_callback(types.void(types.intp, types.intp, types.int32))
    def sense_contacts(model, data, stage):  # type: ignore[no-untyped-def]
        if stage != acceleration_stage:
            return
        address = _engine_address(model, userdata_size_at, numeric_size_at, numeric_at)
        if address == 0:
            return
        engine = carray(_as_engine(address), (1,))[0]
        userdata = _int64(data + userdata_at)
        state = carray(_as_state(userdata), (1,))[0]
        state.contact_forces_w[:, :] = 0.0
        bodies = _int64(model + geom_body_at)
        contacts = _int64(data + contacts_at)
        constraint_forces = _int64(data + constraint_forces_at)
        for i in range(_int32(data + num_contacts_at)):
            contact = contacts + i * contact_size
            row = _int32(contact + row_at)
            segment1 = _segment_of(engine, _int32(bodies + 4 * _int32(contact + geom1_at)))
            segment2 = _segment_of(engine, _int32(bodies + 4 * _int32(contact + geom2_at)))
            if row < 0 or (segment1 < 0 and segment2 < 0):
                continue
            _add_contact_force(
                state.contact_forces_w,
                segment1,
                segment2,
                carray(_as_float64(contact + frame_at), (3, 3)),
                carray(_as_float64(constraint_forces + 8 * row), (10,)),
                carray(_as_float64(contact + friction_at), (5,)),
                _int32(contact + dim_at),
                engine.is_elliptic != 0.0,
            )
        if engine.gait_places != 0.0:
            _log_gait(
                engine,
                carray(_as_parameters(address + engine_bytes), (1,))[0],
                state,
                carray(_as_scratch(userdata + state_bytes), (1,))[0],
                userdata + 8 * int(engine.gait_log_at),
                carray(_as_float64(data + time_at), (1,))[0],
                _int64(data + positions_at),
                carray(_as_float64(_int64(data + torques_at)), (NUM_SERVOS,)),
                carray(_as_float64(_int64(data + velocities_at)), (NUM_SERVOS,)),
            )
        if engine.senses_contact == 0.0:
            state.contact_forces_w[:, :] = 0.0

    return sense_contacts


_CONTROL_TYPE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
_SENSOR_TYPE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)


_ONE_AT_A_TIME = threading.Lock()
"""Two threads would each compile a callback, of which the second one's is not the installed one."""

_PLACES: Final = {
    name: (getattr(mujoco, f"get_{name}"), getattr(mujoco, f"set_{name}"))
    for name in ("mjcb_control", "mjcb_sensor", "mjcb_passive", "mjcb_contactfilter")
}
"""Callbacks of MuJoCo that change how a model of flyrl's moves: how to read and to set each. Those
of actuators and of time do not."""


@functools.cache
def _c_functions() -> dict[str, Any]:
    """Compile our callbacks, by place; that MuJoCo writes no log file is settled here too."""
    _keep_out_of_the_users_folder()
    found = layout()
    with one_process_at_a_time(), announced():
        control, sensor = _control_callback(found), _sensor_callback(found)
    return {
        "mjcb_control": _CONTROL_TYPE(control.address),
        "mjcb_sensor": _SENSOR_TYPE(sensor.address),
    }


@contextlib.contextmanager
def one_process_at_a_time() -> Iterator[None]:
    """Let other processes wait, which then find in the cache what this one has compiled."""
    with Path(__file__).open() as file:
        with contextlib.suppress(OSError):  # a file system without locks
            lock_descriptor(file.fileno())
        yield


@contextlib.contextmanager
def announced() -> Iterator[None]:
    """Say so on stderr, once, if Numba compiles anything meanwhile instead of reading its cache."""
    with install_listener("numba:run_pass", _Announcement()):
        yield


class _Announcement(Listener):
    is_made = False

    def on_start(self, event: Event) -> None:
        if not self.is_made:
            self.is_made = True
            print(
                "flyrl: compiling the controllers once: about 20 s, or minutes on a busy machine",
                file=sys.stderr,
                flush=True,
            )

    def on_end(self, event: Event) -> None:
        pass


def cache_folders() -> list[Path]:
    """Folders in which compiled controllers are kept."""
    kernels: tuple[Any, ...] = (control_step, activate, _segment_of)
    return sorted({Path(kernel.stats.cache_path) for kernel in kernels})


def install() -> None:
    """Install the callbacks into this process where they are missing; takes 0.5 µs if none is.

    Raises
    ------
    RuntimeError
        If somebody else's callback is installed that changes how flyrl's models move.
    """
    with _ONE_AT_A_TIME:
        # looked for before anything is compiled: MuJoCo would call it meanwhile
        ours = _c_functions() if _c_functions.cache_info().currsize else {}
        missing = []
        for name, (get, _) in _PLACES.items():
            present = get()
            if present is None:
                missing.append(name)
            elif not _same_function(present, ours.get(name)):
                raise RuntimeError(
                    f"MuJoCo's {name} is taken by {present!r}, which would change how flyrl's "
                    f"bodies move; remove it with mujoco.set_{name}(None) before they do"
                )
        for name, function in _c_functions().items():
            if name in missing:
                _PLACES[name][1](function)


def _same_function(present: Any, ours: Any) -> bool:
    if present is ours:
        return True
    try:
        return (
            ctypes.cast(present, ctypes.c_void_p).value == ctypes.cast(ours, ctypes.c_void_p).value
        )
    except (ctypes.ArgumentError, TypeError):
        return False


def _keep_out_of_the_users_folder() -> None:
    """Have MuJoCo write its warnings to the console only, unless somebody has set its log."""
    log = mujoco.MjLogConfig.get()
    if log.logto_file and log.logfile == "MUJOCO_LOG.TXT":
        log.logto_file = False
        log.set()
