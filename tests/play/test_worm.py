"""The worm that keys recruit neurons of, without a page."""

import numpy as np
import pytest

from flyrl.bodies.worm import DEMONSTRATION
from flyrl.muscles import MotorPool
from flyrl.play.worm import PlayedWorm
from flyrl.resources import assets_folder
from tests.play.noted import drawn

POOL = MotorPool.from_image(assets_folder() / "muscles" / "human.png")


@pytest.fixture
def worm():
    return PlayedWorm()


def test_tension_is_that_of_the_pool(worm):
    # ten segments, one muscle
    assert (worm.model.njnt, worm.model.nu) == (9, 1)
    for key, n in (("n", 0), ("h", 20), ("h", 40), ("n", 20)):
        worm.change(key, True)
        tension = pytest.approx(POOL.recruitment[n], abs=5e-5)
        assert worm.figures() == {"n": n, "tension": tension, "bend_deg": 0.0}
        assert worm.data.ctrl == pytest.approx(DEMONSTRATION.strength * POOL.recruitment[n])


def test_the_last_neuron_is_the_last(worm):
    for _ in range(20):
        worm.change("h", True)
    assert worm.n == len(POOL) - 1


def test_the_panel_says_neurons_tension_and_bend(worm):
    for _ in range(10):
        worm.change("h", True)
    worm.data.qpos[:3] = np.radians([10, 20, 5])
    tension = pytest.approx(POOL.recruitment[200])
    shown = {"neurons up to": 200, "tension": tension, "bend (°)": pytest.approx(35)}
    assert drawn(worm, "values") == [[shown]]
    assert drawn(worm, "bars") == [[{"": tension}]]
    assert worm.figures()["bend_deg"] == 35.0
    worm.data.qpos[:3] = np.radians([0, 0, -0.04])
    assert str(worm.figures()["bend_deg"]) == "0.0"


def test_it_bends_and_hangs_down_after_a_reset_and_when_nobody_is_there(worm):
    for _ in range(15):
        worm.change("h", True)
    for _ in range(50):
        worm.step()
    assert worm.time_s == pytest.approx(50 * worm.interval_s)
    assert worm.figures()["bend_deg"] > 1
    worm.relax()
    assert (worm.n, worm.figures()["tension"]) == (0, 0)
    worm.change("h", True)
    worm.reset(3)
    assert (worm.n, worm.time_s, worm.seed) == (0, 0.0, 3)
    assert worm.figures() == {"n": 0, "tension": 0.0, "bend_deg": 0.0}
