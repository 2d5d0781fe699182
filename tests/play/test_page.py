"""What is drawn in the page, and where it is clicked."""

import math

import mujoco
import numpy as np
import pytest

from flyrl.play.page import display_model, ground_point
from flyrl.play.worm import PlayedWorm

SCENE = """
<mujoco>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <geom type="box" pos="50 0 1" size="1 1 1"/>
    <body pos="-50 0 1"><geom type="box" size="1 1 1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    ("lookat", "elevation", "place", "expected"),
    [
        ((1, 2, 0), -30, (0.5, 0.5), (1, 2)),
        # MuJoCo's field of view is 45° high: from 10 mm above, 2 * 10 tan 22.5° of the ground
        ((1, 2, 0), -90, (0.5, 0.0), (1, 2 + 10 * math.tan(math.radians(22.5)))),
        ((1, 2, 0), -90, (1.0, 0.5), (1 + 20 * math.tan(math.radians(22.5)), 2)),
        # the sky
        ((1, 2, 0), -10, (0.5, 0.0), None),
        # the side of a block that belongs to the ground, and a body in front of the ground
        ((50, 0, 1), 0, (0.5, 0.5), (50, -1)),
        ((-50, 0, 1), -30, (0.5, 0.5), None),
    ],
)
def test_a_click_meets_the_ground_that_is_seen_there(lookat, elevation, place, expected):
    model = mujoco.MjModel.from_xml_string(SCENE)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 90, elevation, 10
    camera.lookat[:] = lookat
    point = ground_point(model, mujoco.MjData(model), camera, *place, aspect=2.0)
    assert point == (expected and pytest.approx(expected, abs=1e-3))


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
