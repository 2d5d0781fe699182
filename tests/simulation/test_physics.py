import json
from dataclasses import asdict, replace

import pytest

from flyrl.simulation.physics import (
    PHYSICS_PRESETS,
    PRESET_VERSIONS,
    PhysicsConfig,
    PresetVersion,
    preset_version,
)

BALANCED_1 = {
    "timestep": 0.0005,
    "integrator": "discrete",
    "solver_iterations": 100,
    "solver_tolerance": 1e-8,
    "noslip_iterations": 0,
    "cone": "pyramidal",
    "collision_detection": "native",
    "multiccd": False,
    "contact": {
        "plane": {
            "friction": [0.8, 0.005, 0.0001],
            "solref": [-20000.0, -4000.0],
            "solimp": [0.5, 0.99, 0.08, 0.5, 2.0],
            "condim": 3,
            "margin": 0.0,
        },
        "box": {
            "friction": [1.0, 0.005, 0.0001],
            "solref": [-90000.0, -2000.0],
            "solimp": [0.999, 0.9999, 0.001, 0.5, 2.0],
            "condim": 3,
            "margin": 0.0,
        },
        "plane_shape": "capsule",
        "plane_segments": ["Coxa", "Femur", "Tibia", "Tarsus5"],
        "plane_friction_across": 1.2,
    },
}
BALANCED_2 = {
    **BALANCED_1,
    "timestep": 0.0004,
    "contact": {
        **BALANCED_1["contact"],
        "plane": {**BALANCED_1["contact"]["plane"], "solref": [-25000.0, -5000.0]},
        "box": {
            **BALANCED_1["contact"]["box"],
            "friction": [0.7, 0.005, 0.0001],
            "solref": [-70000.0, -2500.0],
            "margin": 0.01,
        },
    },
}


@pytest.mark.parametrize("name", PHYSICS_PRESETS)
def test_settings_tell_the_preset_and_its_version(name):
    settings = asdict(PHYSICS_PRESETS[name])
    expected = PresetVersion(name, PRESET_VERSIONS[name])
    assert preset_version(settings) == expected
    assert preset_version(json.loads(json.dumps(settings))) == expected


@pytest.mark.parametrize(("settings", "version"), [(BALANCED_1, 1), (BALANCED_2, 2)])
def test_an_earlier_version_is_known_by_its_settings(settings, version):
    assert preset_version(settings) == PresetVersion("balanced", version)


@pytest.mark.parametrize(
    "settings", [asdict(replace(PhysicsConfig(), timestep=2e-4)), {}, {"timestep": "balanced"}]
)
def test_other_settings_are_no_preset(settings):
    assert preset_version(settings) is None
