import pytest

from flyrl.simulation.engine import Layout, check_layout, layout


@pytest.mark.parametrize("field", [name for name in Layout._fields if name != "contact_size"])
def test_a_wrong_offset_is_noticed(field: str) -> None:
    with pytest.raises(RuntimeError, match=f"'{field}'"):
        check_layout(layout()._replace(**{field: 0 if getattr(layout(), field) else 8}))
