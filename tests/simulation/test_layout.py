import ctypes
import dataclasses

import mujoco
import pytest

from flyrl.simulation import layout as layout_module
from flyrl.simulation.layout import layout


def test_offset_of_userdata_leads_to_the_bindings_array() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><size nuserdata='4'/></mujoco>")
    data = mujoco.MjData(model)
    data.userdata[:] = [1.0, 2.0, 3.0, 4.0]
    pointer = ctypes.c_void_p.from_address(data._address + layout().data["userdata"]).value
    assert pointer is not None
    assert list((ctypes.c_double * 4).from_address(pointer)) == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("struct", ["model", "data", "contact"])
def test_a_wrong_offset_is_noticed(struct: str) -> None:
    found = layout()
    for field in getattr(found, struct):
        wrong = dataclasses.replace(found, **{struct: {**getattr(found, struct), field: 0}})
        with pytest.raises(RuntimeError, match=f"'{field}'"):
            layout_module._check(wrong)
