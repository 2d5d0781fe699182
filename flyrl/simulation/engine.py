"""Where the control callback finds what it needs: flyrl's records, and fields of MuJoCo's structs.

A model that flyrl built carries the record `ENGINE`, the controller's parameters and the muscles in
its first custom numeric. `mjData.userdata`, which is part of MuJoCo's integration state, holds the
record of `userdata_dtype`: what the controller senses, its state, its output, and the commands that
are on their way to it. So saving, restoring and replaying a simulation includes its controller,
exactly.
"""

import ctypes
import functools
import math
import secrets
from collections import namedtuple
from typing import Any, Final

import mujoco
import numpy as np

from flyrl.controllers.controller import CLOCK, NUM_JOINTS, NUM_LEGS, OUTPUT, SENSES
from flyrl.controllers.gait_log import GAIT_LOG

MAGIC = 20_261_121.0
"""Marks a model as flyrl's; a number that no other model's first numeric begins with."""

NUM_SENSED_SEGMENTS = 6
NUM_MUSCLES = 2 * NUM_JOINTS

PROCESS: Final = float(secrets.randbits(52))
"""Beside it in a model, the address of a kernel is one of this process."""

ENGINE = np.dtype(
    [
        ("magic", "f8"),
        ("process", "f8"),
        ("kernel", "f8"),  # address
        ("is_elliptic", "f8"),
        ("thorax_body", "f8"),
        ("num_neurons", "f8"),
        ("senses_contact", "f8"),
        ("is_missing", "f8", (NUM_LEGS,)),
        ("tibia_bodies", "f8", (NUM_LEGS,)),
        ("end_effector_bodies", "f8", (NUM_LEGS,)),
        ("timestep", "f8"),  # s
        ("steps_per_gait_sample", "f8"),
        # how many numbers, and after how many numbers, there are in the userdata
        ("userdata_size", "f8"),
        ("command_size", "f8"),
        ("command_at", "f8"),
        ("arrived_at", "f8"),
        ("queue_places", "f8"),
        ("queue_at", "f8"),
        ("controller_at", "f8"),
        ("retraction_at", "f8"),
        ("stumbling_at", "f8"),
        ("tensions_at", "f8"),
        ("gait_log_at", "f8"),
        ("gait_places", "f8"),
        ("gait_samples_at", "f8"),
        # after how many numbers the muscles follow in the model's data
        ("muscles_at", "f8"),
    ],
    align=True,
)
"""Where the callback finds everything; every field a float64."""

HEAD = np.dtype(
    [
        ("last_time", "f8"),  # s
        ("senses", SENSES),
        ("output", OUTPUT),
        ("clock", CLOCK),
        ("is_grounded", "f8", (NUM_LEGS,)),
        ("none", "f8", (NUM_LEGS,)),  # reflexes of a controller that has none
    ],
    align=True,
)
"""What every simulation carries, at the beginning of its userdata."""


ENGINE_SIZE = ENGINE.itemsize // 8


def bytes_before(field: str) -> int:
    """Offset of a field of HEAD, bytes."""
    assert HEAD.fields is not None
    return int(HEAD.fields[field][1])


def userdata_dtype(
    state: np.dtype, command_size: int, queue_places: int, gait_places: int, has_muscles: bool
) -> np.dtype:
    """Record that a simulation carries for the callback.

    Parameters
    ----------
    state
        Of the controller.
    command_size
        How many numbers a command has.
    queue_places
        How many commands may be on their way.
    gait_places
        How many samples of the gait are kept; with 0 there is no log of it.
    has_muscles
        Whether muscles move the legs.
    """
    fields: list[Any] = [
        ("head", HEAD),
        ("command", "f8", (command_size,)),  # as last commanded
        ("arrived", "f8", (command_size,)),  # at the legs
        ("controller", state),
        ("queue", "f8", (queue_places, 1 + command_size)),
        ("tensions", "f8", (NUM_MUSCLES if has_muscles else 0,)),
        ("gait_log", GAIT_LOG, (min(gait_places, 1),)),
        ("gait_samples", "f8", (gait_places,)),
    ]
    return np.dtype(fields, align=True)


def place_fields(engine: np.void, userdata: np.dtype) -> None:
    """Write the offsets of the fields of a simulation's record into its model's ENGINE record."""
    assert userdata.fields is not None
    at = {name: field[1] // 8 for name, field in userdata.fields.items()}
    own: Any = userdata["controller"].fields or {}
    for name in ("retraction", "stumbling"):
        kept = at["controller"] + own[name][1] // 8 if name in own else bytes_before("none") // 8
        engine[f"{name}_at"] = kept
    for name in at.keys() - {"head"}:
        engine[f"{name}_at"] = at[name]
    engine["userdata_size"] = userdata.itemsize // 8
    engine["command_size"] = userdata["command"].shape[0]
    engine["queue_places"] = userdata["queue"].shape[0]
    engine["gait_places"] = userdata["gait_samples"].shape[0]


# ------------------------------------------------------------------ MuJoCo's own structs

_C_TYPES: dict[str, Any] = {
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "mjtNum": np.ctypeslib.as_ctypes_type(mujoco.MJTNUM_DTYPE),
    "mjtByte": ctypes.c_uint8,
    "mjtBool": ctypes.c_bool,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_void_p,
}

_POINTER: Final = ctypes.c_void_p

FIELDS: Final[dict[str, dict[str, Any]]] = {
    "mjModel": {
        "nuserdata": ctypes.c_int64,
        "nnumericdata": ctypes.c_int64,
        "numeric_data": _POINTER,
        "geom_bodyid": _POINTER,
    },
    "mjData": {
        "time": ctypes.c_double,
        "ncon": ctypes.c_int,
        "contact": _POINTER,
        "ctrl": _POINTER,
        "userdata": _POINTER,
        "xpos": _POINTER,
        "xmat": _POINTER,
        "actuator_force": _POINTER,
        "actuator_length": _POINTER,
        "actuator_velocity": _POINTER,
        "efc_force": _POINTER,
    },
    "mjContact": {
        "frame": 9 * ctypes.c_double,
        "friction": 5 * ctypes.c_double,
        "dim": ctypes.c_int,
        "geom1": ctypes.c_int,
        "geom2": ctypes.c_int,
        "efc_address": ctypes.c_int,
    },
}
"""Fields that the callbacks read and write, and their C types."""

Layout = namedtuple(  # type: ignore[misc]  # the names are computed
    "Layout", [*(name for fields in FIELDS.values() for name in fields), "contact_size"]
)
"""Offset of each of `FIELDS` in its struct, and the size of a contact, bytes."""


def _c_type(node: Any) -> Any:
    """C type that a node of `mujoco.introspect` describes."""
    from mujoco.introspect import ast_nodes, structs  # noqa: PLC0415  (0.2 s: when installing)

    if isinstance(node, ast_nodes.PointerType):
        return _POINTER
    if isinstance(node, ast_nodes.ArrayType):
        return math.prod(node.extents) * _c_type(node.inner_type)
    if isinstance(node, ast_nodes.ValueType):
        if node.name in _C_TYPES:
            return _C_TYPES[node.name]
        node = structs.STRUCTS[node.name]
    c_fields = [(field.name, _c_type(field.type)) for field in node.fields]
    return type("Struct", (ctypes.Structure,), {"_fields_": c_fields})


@functools.cache
def layout() -> Any:
    """`Layout` of this MuJoCo, after they were checked against a live simulation.

    MuJoCo describes its structs in `mujoco.introspect`.

    Raises
    ------
    RuntimeError
        If the installed MuJoCo does not lay its structs out as it describes them.
    """
    from mujoco.introspect.structs import STRUCTS  # noqa: PLC0415

    structs = {name: _c_type(STRUCTS[name]) for name in FIELDS}
    offsets = [getattr(structs[name], field).offset for name in FIELDS for field in FIELDS[name]]
    found = Layout._make([*offsets, ctypes.sizeof(structs["mjContact"])])
    check_layout(found)
    return found


_PROBE = """
<mujoco>
  <size nuserdata="3"/>
  <custom><numeric name="probe" data="5 6 7 8"/></custom>
  <option cone="elliptic"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body pos="0.2 0 0.09"><freejoint/><geom size="0.1" friction="1 0.5 0.1" condim="6"/></body>
    <body pos="-0.2 0 0.09"><joint name="slide" type="slide"/><geom size="0.1"/></body>
  </worldbody>
  <actuator><motor joint="slide"/></actuator>
</mujoco>
"""


def check_layout(found: Any) -> None:
    """Compare each offset with what MuJoCo's bindings say of a simulation with two contacts."""
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = 0.25
    mujoco.mj_forward(model, data)
    # the bindings' array of distances begins where the contacts do
    contacts = data.contact.dist.ctypes.data
    # the bindings' only way to the address of a struct; where it fails, so does every test of ours
    structs = {
        "mjModel": (model._address, model),
        "mjData": (data._address, data),
        "mjContact": (contacts + found.contact_size, data.contact[1]),
    }
    for struct, (address, bindings) in structs.items():
        for name, c_type in FIELDS[struct].items():
            offset_says = c_type.from_address(address + getattr(found, name))
            bindings_say = contacts if name == "contact" else getattr(bindings, name)
            if c_type is _POINTER and name != "contact":
                bindings_say = bindings_say.ctypes.data
            if not np.array_equal(getattr(offset_says, "value", offset_says), bindings_say):
                raise RuntimeError(
                    f"MuJoCo {mujoco.__version__} does not lay out {name!r} as it describes it: "
                    f"expected {bindings_say!r}"
                )
