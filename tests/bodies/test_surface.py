import pytest

from flyrl.bodies.surface import ContactConfig, SurfaceContact


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (SurfaceContact, {"friction": (1.0, 0.1)}, "contact.friction must be a list of 3, got"),
        (SurfaceContact, {"solref": (2e-4, -1.0)}, "two positive numbers"),
        (ContactConfig, {"plane_segments": ("Tarsus6",)}, "plane_segments .*'Tarsus6'; did you"),
        (
            ContactConfig,
            {"plane_friction_across": 1.0, "plane_shape": "hull"},
            "a hull has no axis",
        ),
    ],
)
def test_contacts_name_what_is_allowed(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(**arguments)
