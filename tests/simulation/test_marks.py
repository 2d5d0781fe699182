"""Ribbons and arrows, worked out by hand."""

import mujoco
import numpy as np
import pytest

from flyrl.anatomy import CONTACT_SEGMENTS, LEGS
from flyrl.simulation.marks import Trace, add_marks, force_arrows
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


def heights(terrain, places):
    trace = Trace(terrain)
    for i, x in enumerate(places):
        trace.add(0.1 * i, np.array([x, -19.35, 1.3]), terrain.draw(0))
    marks = trace.marks()
    return np.array([marks[0].start[2], *(mark.end[2] for mark in marks)])


def test_a_trace_lies_on_the_ground_and_spans_gaps():
    # a low block, a high one, a gap, and the slab beyond it
    found = heights(Mixed(), [-2.05, -0.75, 0.55, 1.0])
    np.testing.assert_allclose(found - found[0], [0.0, 0.35, 0.35, 0.35])
    assert 0 < found[1] < 0.05


def test_on_flat_ground_a_trace_lies_on_the_plane():
    found = heights(FLAT, [0.0, 1.0])
    assert (found > 0).all()
    assert (found < 0.05).all()


def test_a_trace_starts_anew_with_an_episode():
    trace = Trace(FLAT)
    for time, x in ((0.0, 5.0), (0.1, 6.0), (0.0, 1.0), (0.1, 2.0)):
        trace.add(time, np.array([x, 0.0, 1.3]), FLAT.draw(0))
    assert [(mark.start[0], mark.end[0]) for mark in trace.marks()] == [(1.0, 2.0)]


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
