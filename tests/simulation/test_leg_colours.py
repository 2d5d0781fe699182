from contextlib import closing

import mujoco
import numpy as np
import pytest

from flyrl.anatomy import LEG_SEGMENTS, LEGS
from flyrl.bodies.fly import FlyConfig
from flyrl.controllers.leg_controller import initial_state
from flyrl.simulation.batch import FlyBatch
from flyrl.simulation.leg_colours import LEG_COLOURS, LegColours
from flyrl.simulation.overlay import Overlay
from flyrl.simulation.rendering import FlyRenderer, RenderingUnavailableError
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.simulation.state import LegStates
from flyrl.terrains import TerrainConfig

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


def test_pictures_have_coloured_legs_where_they_are_asked_for() -> None:
    config = SceneConfig(terrain=TerrainConfig(name="flat"))
    flies = FlyBatch(build_scene(config), num_threads=1)
    start = initial_state(config.controller)
    flies.reset(np.array([0]), np.array([[0.0, 0.0, 0.5]]), np.zeros(1), [start])
    flies.controllers["adhesion"] = 0.0
    try:
        plain, marked = (
            FlyRenderer(config, 160, 120, overlay=Overlay(leg_colours=colours, trace=False))
            for colours in (False, True)
        )
    except RenderingUnavailableError as error:
        pytest.skip(str(error))
    with closing(plain), closing(marked):
        usual = plain.render(flies)
        np.testing.assert_array_equal(marked.render(flies), usual)
        flies.controllers["adhesion"] = 1.0
        np.testing.assert_array_equal(plain.render(flies), usual)
        changed = marked.render(flies) != usual
        assert changed.any(axis=2).sum() > 20
        flies.controllers["adhesion"] = 0.0
        np.testing.assert_array_equal(marked.render(flies), usual)
