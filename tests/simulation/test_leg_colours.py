import mujoco
import numpy as np
import pytest

from flyrl.anatomy import LEG_SEGMENTS, LEGS
from flyrl.bodies.fly import FlyConfig
from flyrl.simulation.marks import LEG_COLOURS, LegColours, LegStates
from flyrl.simulation.scene import SceneConfig, build_scene

TARSI = LEG_SEGMENTS[3:]


def states(**legs: str) -> LegStates:
    """What the named legs do; the others do nothing."""
    fields = ("grips", "retracts", "stumbles")
    return LegStates(*(np.array([leg == legs.get(field) for leg in LEGS]) for field in fields))


def coloured(model: mujoco.MjModel, usual: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Bodies with meshes that have not their usual colour, and the one they have."""
    changed = np.flatnonzero((model.geom_rgba != usual).any(axis=1))
    return {
        model.body(model.geom_bodyid[geom]).name: tuple(model.geom_rgba[geom])
        for geom in changed
        if model.geom(geom).name.endswith("_visual")
    }


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_scene(SceneConfig(), visual=True).model


@pytest.mark.parametrize(
    ("field", "segments"),
    [("grips", TARSI), ("retracts", ("Tibia",)), ("stumbles", ("Femur",))],
)
def test_each_state_colours_its_segments_of_its_leg(
    model: mujoco.MjModel, field: str, segments: tuple[str, ...]
) -> None:
    usual = model.geom_rgba.copy()
    legs = LegColours(model)
    legs.apply(states(**{field: "RM"}))
    found = coloured(model, usual)
    assert set(found) == {f"RM{segment}" for segment in segments}
    for red, green, blue, opacity in found.values():
        # of the hue that the legend names, and opaque
        shares = np.array([red, green, blue]) / max(red, green, blue)
        expected = np.array(LEG_COLOURS[field]) / max(LEG_COLOURS[field])
        np.testing.assert_allclose(shares, expected, atol=1e-6)
        assert opacity == 1.0
    legs.apply(states())
    np.testing.assert_array_equal(model.geom_rgba, usual)


def test_a_missing_leg_has_nothing_to_colour() -> None:
    config = SceneConfig(body=FlyConfig(missing_legs=("LM",)))
    model = build_scene(config, visual=True).model
    usual = model.geom_rgba.copy()
    legs = LegColours(model)
    legs.apply(states(grips="LM", retracts="LM", stumbles="LM"))
    np.testing.assert_array_equal(model.geom_rgba, usual)
    legs.apply(states(grips="LF"))
    assert set(coloured(model, usual)) == {f"LF{segment}" for segment in TARSI}
