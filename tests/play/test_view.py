"""The model that is drawn, and the place where a click meets the ground."""

import math

import mujoco
import numpy as np
import pytest

from flyrl.play.page import View, camera_view, copy_state, display_model, ground_point
from flyrl.play.worm import PlayedWorm
from tests.play.toy import Toy

DOWN = View(np.array([1.0, 2.0, 10.0]), np.array([0, 0, -1.0]), np.array([0, 1.0, 0]), 0.5)
"""From 10 mm above (1, 2), with the world's y upwards in the picture: 10 mm of it, 20 across."""


@pytest.mark.parametrize(
    ("x", "y", "place"),
    [
        (0.5, 0.5, (1, 2)),
        (1.0, 0.5, (11, 2)),
        (0.5, 0.0, (1, 7)),
        (0.25, 0.75, (-4, -0.5)),
    ],
)
def test_straight_down(x, y, place):
    assert ground_point(DOWN, x, y, aspect=2.0) == pytest.approx(place)


def test_at_an_angle_of_45_degrees():
    half = math.sqrt(0.5)
    view = View(
        np.array([0, 0, 3.0]), np.array([half, 0, -half]), np.array([half, 0, half]), slope=1.0
    )
    assert ground_point(view, 0.5, 0.5, 1.0) == pytest.approx((3, 0))
    # the lower edge looks straight down
    assert ground_point(view, 0.5, 1.0, 1.0) == pytest.approx((0, 0))
    # to the right is -y
    assert ground_point(view, 1.0, 0.5, 1.0) == pytest.approx((3, -3 / half))
    # the upper edge looks at the horizon
    assert ground_point(view, 0.5, 0.0, 1.0) is None


def test_the_sky_is_no_ground():
    up = DOWN._replace(forward_w=np.array([0, 0, 1.0]))
    assert ground_point(up, 0.5, 0.5, 1.0) is None


def test_a_camera_sees_what_it_looks_at_in_the_middle():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90.0, -30.0, 8.0
    camera.lookat[:] = (1.0, 2.0, 0.0)
    view = camera_view(model, data, camera)
    # from the south, 8 sin 30° high
    assert view.position_w == pytest.approx((1, 2 - 8 * math.cos(math.radians(30)), 4), abs=1e-5)
    # MuJoCo's field of view is 45° high
    assert view.slope == pytest.approx(math.tan(math.radians(22.5)), rel=1e-5)
    assert ground_point(view, 0.5, 0.5, 1.6) == pytest.approx((1, 2), abs=1e-4)


def test_what_is_drawn_knows_no_forces():
    worm = PlayedWorm()
    forces, constraints = [], []
    for model in (worm.model, display_model(worm.model)):
        data = mujoco.MjData(model)
        data.ctrl[:], data.qpos[:] = 100.0, 2.0  # beyond the joints' limits
        mujoco.mj_forward(model, data)
        forces.append(np.abs(data.qfrc_actuator).max())
        constraints.append(data.nefc)
    assert forces == [pytest.approx(100), 0]
    assert constraints == [worm.model.njnt, 0]


def test_mocap_bodies_are_drawn_where_they_are():
    toy = Toy()
    toy.point(5.0, -1.0)
    toy.data.qpos[0] = 0.7
    toy.data.mocap_quat[0] = (0.6, 0.8, 0, 0)
    model = display_model(toy.model)
    data = mujoco.MjData(model)
    copy_state(toy.data, data)
    mujoco.mj_forward(model, data)
    assert data.body("target").xpos == pytest.approx((5, -1, 0.2))
    assert data.body("target").xquat == pytest.approx((0.6, 0.8, 0, 0))
    assert data.body("cart").xpos == pytest.approx((0.7, 0, 1))
