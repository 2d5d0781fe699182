import ctypes

import mujoco
import pytest

from flyrl.simulation.engine import Layout, check_layout, layout


def test_offset_of_userdata_leads_to_the_bindings_array() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><size nuserdata='4'/></mujoco>")
    data = mujoco.MjData(model)
    data.userdata[:] = [1.0, 2.0, 3.0, 4.0]
    pointer = ctypes.c_void_p.from_address(data._address + layout().userdata).value
    assert pointer is not None
    assert list((ctypes.c_double * 4).from_address(pointer)) == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("field", [name for name in Layout._fields if name != "contact_size"])
def test_a_wrong_offset_is_noticed(field: str) -> None:
    with pytest.raises(RuntimeError, match=f"'{field}'"):
        check_layout(layout()._replace(**{field: 0 if getattr(layout(), field) else 8}))
