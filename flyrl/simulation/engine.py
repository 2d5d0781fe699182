"""Where the control callback finds what it needs: flyrl's records, and fields of MuJoCo's structs.

A model that flyrl built carries the record `ENGINE`, the controller's parameters and the muscles in
its first custom numeric. `mjData.userdata`, which is part of MuJoCo's integration state, holds the
record of `userdata_dtype`: what the controller senses, its state, its output, and the commands that
are on their way to it. So saving, restoring and replaying a simulation includes its controller,
exactly. Worms have a mark of their own: their models carry the muscles, and their userdata how many
neurons are recruited and the muscles' tensions.
"""

import ctypes
import functools
import secrets
from collections import namedtuple
from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np

from flyrl.controllers.controller import CLOCK, NUM_JOINTS, NUM_LEGS, OUTPUT, SENSES
from flyrl.controllers.gait_log import GAIT_LOG
from flyrl.muscles import Muscle, pack_muscles

MAGIC = 20_261_121.0
"""Marks a model as flyrl's; a number that no other model's first numeric begins with."""

CREATURE_MAGIC = 20_261_122.0
"""Marks a model of another creature, which has muscles and no leg controller."""

CREATURE_HEAD = 3
"""How many numbers a creature's model carries before its muscles' arrays."""

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
    ]
    if queue_places:
        fields.append(("queue", "f8", (queue_places, 1 + command_size)))
    if has_muscles:
        fields.append(("tensions", "f8", (NUM_MUSCLES,)))
    if gait_places:
        fields += [("gait_log", GAIT_LOG), ("gait_samples", "f8", (gait_places,))]
    return np.dtype(fields, align=True)


def place_fields(engine: np.void, userdata: np.dtype) -> None:
    """Write the offsets of the fields of a simulation's record into its model's ENGINE record."""
    assert userdata.fields is not None
    at = {name: field[1] // 8 for name, field in userdata.fields.items()}
    engine["userdata_size"] = userdata.itemsize // 8
    engine["command_size"] = userdata["command"].shape[0]
    for name in ("command", "arrived", "controller", "queue", "tensions"):
        engine[f"{name}_at"] = at.get(name, 0)
    if "queue" in at:
        engine["queue_places"] = userdata["queue"].shape[0]
    if "gait_log" in at:
        engine["gait_places"] = userdata["gait_samples"].shape[0]
        engine["gait_log_at"], engine["gait_samples_at"] = at["gait_log"], at["gait_samples"]
    own: Any = userdata["controller"].fields or {}
    for name in ("retraction", "stumbling"):
        kept = at["controller"] + own[name][1] // 8 if name in own else bytes_before("none") // 8
        engine[f"{name}_at"] = kept


def pack_model_data(engine: np.void, parameters: np.void, muscles: np.ndarray) -> np.ndarray:
    """Concatenate what a model carries for the callback into one float64 array.

    The last is what `fly_scene.pack_leg_muscles` gives.
    """
    engine["muscles_at"] = (ENGINE.itemsize + parameters.nbytes) // 8
    return np.concatenate(
        [np.frombuffer(engine.tobytes()), np.frombuffer(parameters.tobytes()), muscles]
    )


def pack_creature_data(muscles: Sequence[Muscle]) -> np.ndarray:
    """Concatenate what a creature's model carries for the callback into one float64 array.

    The mark, the number M of muscles, that of the entries of their tables, and `PackedMuscles`:
    starts (M + 1), strengths (M), recruitment tables. Actuator i is muscle i.
    """
    packed = pack_muscles(muscles)
    head = (CREATURE_MAGIC, len(packed.strengths), len(packed.recruitment))
    return np.concatenate([head, packed.starts, packed.strengths, packed.recruitment])


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
    from mujoco.introspect import ast_nodes  # noqa: PLC0415  (0.2 s: only once, when installing)

    if isinstance(node, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(node, ast_nodes.ArrayType):
        c_type = _c_type(node.inner_type)
        for extent in reversed(node.extents):
            c_type = c_type * extent
        return c_type
    if isinstance(node, ast_nodes.ValueType):
        return _C_TYPES[node.name] if node.name in _C_TYPES else _c_struct(node.name)
    return _structure("anonymous", node.fields)


def _structure(name: str, fields: Any) -> type[ctypes.Structure]:
    c_fields = [(field.name, _c_type(field.type)) for field in fields]
    return type(name, (ctypes.Structure,), {"_fields_": c_fields})


@functools.cache
def _c_struct(name: str) -> type[ctypes.Structure]:
    from mujoco.introspect import structs  # noqa: PLC0415

    if name not in structs.STRUCTS:
        raise RuntimeError(f"MuJoCo {mujoco.__version__} has no struct {name!r} to lay out")
    return _structure(name, structs.STRUCTS[name].fields)


@functools.cache
def layout() -> Any:
    """`Layout` of this MuJoCo, after they were checked against a live simulation.

    MuJoCo describes its structs in `mujoco.introspect`.

    Raises
    ------
    RuntimeError
        If the installed MuJoCo does not lay its structs out as it describes them.
    """
    offsets = [
        getattr(_c_struct(struct), name).offset
        for struct, fields in FIELDS.items()
        for name in fields
    ]
    found = Layout._make([*offsets, ctypes.sizeof(_c_struct("mjContact"))])
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
