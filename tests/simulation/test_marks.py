"""Ribbons and arrows, worked out by hand; colours of legs."""

import mujoco
import numpy as np
import pytest

from flyrl.anatomy import CONTACT_SEGMENTS, LEG_SEGMENTS, LEGS
from flyrl.bodies.fly import FlyConfig
from flyrl.simulation.marks import (
    LEG_COLOURS,
    LegColours,
    Trace,
    add_marks,
    force_arrows,
)
from flyrl.simulation.scene import SceneConfig, build_scene
from flyrl.terrains import Flat, Mixed

FLAT = Flat()


def test_an_arrow_is_as_long_as_the_force_on_all_of_its_leg():
    forces = np.zeros((36, 3))
    forces[CONTACT_SEGMENTS.index("RMTarsus4")] = (0.0, 6.0, 20.0)
    forces[CONTACT_SEGMENTS.index("RMTarsus5")] = (0.0, -6.0, 25.0)
    forces[CONTACT_SEGMENTS.index("LFTarsus5")] = (0.0, 0.0, 0.9)  # too weak to be drawn
    feet = np.arange(18.0).reshape(6, 3)
    (arrow,) = force_arrows(forces, feet)
    foot = feet[LEGS.index("RM")]
    np.testing.assert_allclose(arrow.start, foot)
    # 45 µN upwards, at 30 µN per mm
    np.testing.assert_allclose(arrow.end, np.add(foot, (0.0, 0.0, 1.5)))


def test_a_trace_lies_on_the_ground_and_spans_gaps():
    # a low block, a high one, a gap, and the slab beyond it
    trace = Trace(Mixed())
    for i, x in enumerate([-2.05, -0.75, 0.55, 1.0]):
        trace.add(0.1 * i, np.array([x, -19.35, 1.3]), Mixed().draw(0))
    ends = np.array([mark.end[2] for mark in trace.marks()])
    np.testing.assert_allclose(ends - trace.marks()[0].start[2], [0.35, 0.35, 0.35])
    assert 0 < ends[0] < 0.05


def test_a_trace_starts_anew_with_an_episode():
    trace = Trace(FLAT)
    for time, x in ((0.0, 5.0), (0.1, 6.0), (0.0, 1.0), (0.1, 2.0)):
        trace.add(time, np.array([x, 0.0, 1.3]), FLAT.draw(0))
    (mark,) = trace.marks()
    assert (mark.start[0], mark.end[0]) == (1.0, 2.0)
    assert 0 < mark.start[2] == mark.end[2] < 0.05  # on the plane


def test_marks_are_drawn_where_they_are_to_be_as_many_as_there_is_room_for():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    scene = mujoco.MjvScene(model, maxgeom=2)
    trace = Trace(FLAT)
    for i, place in enumerate([(0.0, 0.0), (3.0, 4.0), (3.0, 5.0), (3.0, 6.0)]):
        trace.add(0.1 * i, np.array([*place, 1.3]), FLAT.draw(0))
    add_marks(trace.marks(), scene)
    assert scene.ngeom == 2
    ribbon = scene.geoms[0]
    np.testing.assert_allclose(ribbon.pos[:2], (1.5, 2.0), atol=1e-6)
    assert ribbon.size[0] == pytest.approx(2.5)
    # along the path, and flat
    np.testing.assert_allclose(ribbon.mat[:, 0], (0.6, 0.8, 0.0), atol=1e-6)
    np.testing.assert_allclose(ribbon.mat[:, 2], (0.0, 0.0, 1.0), atol=1e-6)


# ------------------------------------------------------------------ legs

TARSI = LEG_SEGMENTS[3:]


def states(**legs: str) -> dict[str, np.ndarray]:
    """What the named legs do; the others do nothing."""
    return {state: np.array([leg == legs.get(state) for leg in LEGS]) for state in LEG_COLOURS}


def coloured(model: mujoco.MjModel, usual: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Bodies with meshes that have not their usual colour, and the one they have."""
    changed = np.flatnonzero((model.geom_rgba != usual).any(axis=1))
    return {
        model.body(model.geom_bodyid[geom]).name: tuple(model.geom_rgba[geom])
        for geom in changed
        if model.geom(geom).name.endswith("_visual")
    }


@pytest.mark.parametrize(
    ("field", "segments"),
    [("grips", TARSI), ("retracts", ("Tibia",)), ("stumbles", ("Femur",))],
)
def test_each_state_colours_its_segments_of_its_leg(field, segments) -> None:
    """As the legend says, and opaque; a leg that is missing has nothing to colour."""
    config = SceneConfig(body=FlyConfig(missing_legs=("LM",)))
    model = build_scene(config, visual=True).model
    usual = model.geom_rgba.copy()
    legs = LegColours(model)
    legs.apply(states(**{field: "LM"}))
    np.testing.assert_array_equal(model.geom_rgba, usual)
    legs.apply(states(**{field: "RM"}))
    found = coloured(model, usual)
    assert set(found) == {f"RM{segment}" for segment in segments}
    for *colour, opacity in found.values():
        hue = np.array(LEG_COLOURS[field]) / max(LEG_COLOURS[field])
        np.testing.assert_allclose(np.array(colour) / max(colour), hue, atol=1e-6)
        assert opacity == 1.0
    legs.apply(states())
    np.testing.assert_array_equal(model.geom_rgba, usual)
