"""What is drawn knows no forces."""

import mujoco
import numpy as np
import pytest

from flyrl.play.page import copy_state, display_model
from flyrl.play.worm import PlayedWorm
from tests.play.toy import Toy


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
