import pytest

from flyrl.bodies.contact import ContactConfig, SurfaceContact


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": (1.0, 0.1)}, "contact.friction must be a tuple of 3, got"),
        (
            {"friction": (-1.0, 0.0, 0.0)},
            r"friction\[0\] must be .* from 0 to 1000, got -1\.0",
        ),
        ({"solref": (2e-4, -1.0)}, "two positive numbers"),
        (
            {"solimp": (0.9, 0.9, 0.001, 0.5, float("inf"))},
            r"solimp\[4\] must be .* got inf",
        ),
        ({"condim": 2}, "1, 3, 4, 6"),
        ({"margin": -0.1}, "margin must be a finite number from 0 to 10, got -0.1"),
    ],
)
def test_surface_contact_names_what_is_allowed(arguments, message):
    with pytest.raises(ValueError, match=message):
        SurfaceContact(**arguments)


def test_contact_config_names_the_shapes_it_allows():
    with pytest.raises(ValueError, match="plane_shape must be one of 'capsule', 'hull', got 'box'"):
        ContactConfig(plane_shape="box")


def test_contact_config_names_the_segments_it_allows():
    with pytest.raises(ValueError, match=r"plane_segments must be one of .*'Tarsus6'; did you"):
        ContactConfig(plane_segments=("Tibia", "Tarsus6"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"plane_friction_across": -0.1}, "plane_friction_across must be a finite number from 0"),
        ({"plane_friction_across": 1.0, "plane_shape": "hull"}, "a hull has no axis"),
    ],
)
def test_contact_config_says_which_friction_across_a_foot_it_allows(arguments, message):
    with pytest.raises(ValueError, match=message):
        ContactConfig(**arguments)
