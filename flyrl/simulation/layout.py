"""Byte offsets of fields inside MuJoCo's C structs, checked against a live simulation.

MuJoCo describes its structs in `mujoco.introspect`; the native callback needs the offsets of
a few fields in `mjModel`, `mjData` and `mjContact`. This is the only module that knows them.
"""

import ctypes
import functools
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

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

MODEL_FIELDS = ("opt", "nuserdata", "nnumericdata", "numeric_data", "geom_bodyid")
DATA_POINTERS = (
    "ctrl",
    "userdata",
    "xpos",
    "xmat",
    "actuator_force",
    "actuator_length",
    "actuator_velocity",
    "efc_force",
)
DATA_FIELDS = ("time", "ncon", "contact", *DATA_POINTERS)
CONTACT_FIELDS = ("frame", "friction", "dim", "geom1", "geom2", "efc_address")


@dataclass(frozen=True)
class Layout:
    """Offsets in bytes, and the size of one contact."""

    model: dict[str, int]
    data: dict[str, int]
    contact: dict[str, int]
    contact_size: int


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


def _offsets(name: str, fields: tuple[str, ...]) -> dict[str, int]:
    struct = _c_struct(name)
    return {field: getattr(struct, field).offset for field in fields}


@functools.cache
def layout() -> Layout:
    """Offsets of this MuJoCo, after they were checked against a live simulation.

    Raises
    ------
    RuntimeError
        If the installed MuJoCo does not lay its structs out as it describes them.
    """
    found = Layout(
        model=_offsets("mjModel", MODEL_FIELDS),
        data=_offsets("mjData", DATA_FIELDS),
        contact=_offsets("mjContact", CONTACT_FIELDS),
        contact_size=ctypes.sizeof(_c_struct("mjContact")),
    )
    _check(found)
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


def _check(found: Layout) -> None:
    """Compare each offset with what MuJoCo's bindings say of a simulation with two contacts."""
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = 0.25
    mujoco.mj_forward(model, data)
    contact = data.contact[1]
    # the bindings' array of distances begins where the contacts do
    contacts = data.contact.dist.ctypes.data

    model_read = functools.partial(_read_field, model._address, found.model)
    data_read = functools.partial(_read_field, data._address, found.data)
    contact_read = functools.partial(_read_field, contacts + found.contact_size, found.contact)
    pairs = [(model_read("opt", ctypes.c_double), model.opt.timestep)]
    pairs += [
        (model_read(name, ctypes.c_int64), getattr(model, name))
        for name in ("nuserdata", "nnumericdata")
    ]
    pairs += [
        (model_read(name, ctypes.c_void_p), getattr(model, name).ctypes.data)
        for name in ("numeric_data", "geom_bodyid")
    ]
    pairs += [(data_read("time", ctypes.c_double), data.time)]
    pairs += [(data_read("ncon", ctypes.c_int), data.ncon)]
    pairs += [
        (data_read(name, ctypes.c_void_p), getattr(data, name).ctypes.data)
        for name in DATA_POINTERS
    ]
    pairs += [(data_read("contact", ctypes.c_void_p), contacts)]
    pairs += [
        (contact_read(name, ctypes.c_int), getattr(contact, name))
        for name in ("dim", "geom1", "geom2", "efc_address")
    ]
    pairs += [
        (contact_read(name, ctypes.c_double, item), getattr(contact, name)[item])
        for name in ("frame", "friction")
        for item in (0, 2)
    ]
    for (name, offset_says), bindings_say in pairs:
        if offset_says != bindings_say:
            raise RuntimeError(
                f"MuJoCo {mujoco.__version__} does not lay out {name!r} as it describes it: "
                f"found {offset_says!r}, expected {bindings_say!r}"
            )


def _read(address: int, c_type: Any) -> Any:
    return c_type.from_address(address).value


def _read_field(
    address: int, offsets: dict[str, int], name: str, c_type: Any, item: int = 0
) -> tuple[str, Any]:
    return name, _read(address + offsets[name] + item * ctypes.sizeof(c_type), c_type)
