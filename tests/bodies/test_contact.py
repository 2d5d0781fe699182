import pytest

from flyrl.bodies.contact import ContactConfig, SurfaceContact


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": (1.0, 0.1)}, "friction: got"),
        ({"friction": (-1.0, 0.0, 0.0)}, ">= 0"),
        ({"solref": (2e-4, -1.0)}, "two positive numbers"),
        ({"solimp": (0.9, 0.9, 0.001, 0.5, float("inf"))}, "solimp: got"),
        ({"condim": 2}, "1, 3, 4, 6"),
        ({"margin": -0.1}, "margin: got"),
    ],
)
def test_surface_contact_names_what_is_allowed(arguments, message):
    with pytest.raises(ValueError, match=message):
        SurfaceContact(**arguments)


def test_contact_config_names_the_shapes_it_allows():
    with pytest.raises(ValueError, match="plane_shape: got 'box', allowed are capsule, hull"):
        ContactConfig(plane_shape="box")


def test_contact_config_names_the_segments_it_allows():
    with pytest.raises(ValueError, match="plane_segments: got 'Tarsus6', allowed are Coxa, "):
        ContactConfig(plane_segments=("Tibia", "Tarsus6"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"plane_friction_across": -0.1}, "plane_friction_across: got -0.1, allowed is a number"),
        ({"plane_friction_across": 1.0, "plane_shape": "hull"}, "a hull has no axis"),
    ],
)
def test_contact_config_says_which_friction_across_a_foot_it_allows(arguments, message):
    with pytest.raises(ValueError, match=message):
        ContactConfig(**arguments)
