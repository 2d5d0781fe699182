import json
from dataclasses import asdict, replace

import pytest

from flyrl.bodies.surface import ContactConfig, SurfaceContact
from flyrl.simulation.physics import (
    PHYSICS_PRESETS,
    PRESET_VERSIONS,
    PhysicsConfig,
    preset_version,
)

PLANE = SurfaceContact((0.8, 0.005, 0.0001), (-2.5e4, -5e3), (0.5, 0.99, 0.08, 0.5, 2.0))
BALANCED_2 = PhysicsConfig(
    timestep=4e-4,
    contact=ContactConfig(
        plane=PLANE,
        box=SurfaceContact((0.7, 0.005, 0.0001), (-7e4, -2500.0), margin=0.01),
        plane_segments=("Coxa", "Femur", "Tibia", "Tarsus5"),
        plane_friction_across=1.2,
    ),
)
BALANCED_1 = replace(
    BALANCED_2,
    timestep=5e-4,
    contact=replace(
        BALANCED_2.contact,
        plane=replace(PLANE, solref=(-2e4, -4e3)),
        box=SurfaceContact(solref=(-9e4, -2e3)),
    ),
)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        *((PHYSICS_PRESETS[name], (name, PRESET_VERSIONS[name])) for name in PHYSICS_PRESETS),
        (BALANCED_1, ("balanced", 1)),
        (BALANCED_2, ("balanced", 2)),
        (PhysicsConfig(timestep=2e-4), None),
    ],
)
def test_settings_tell_the_preset_and_its_version(settings, expected):
    assert preset_version(asdict(settings)) == expected
    assert preset_version(json.loads(json.dumps(asdict(settings)))) == expected


def test_what_are_no_settings_is_no_preset():
    assert preset_version({"timestep": "balanced"}) is None
