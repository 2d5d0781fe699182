"""The log's sums and samples, from steps made up by hand."""

import numpy as np
import pytest

from flyrl.anatomy import LEGS
from flyrl.controllers.gait_log import (
    BITS,
    CONTACT_THRESHOLD,
    GAIT_LOG,
    STANCE_SPEED,
    grounded_legs,
    grounded_legs_of,
    log_gait,
    unpack,
)

TIMESTEP = 5e-4


class Fly:
    """What the log sees of a fly, and its log."""

    def __init__(self, places=8, steps_per_sample=1):
        self.log = np.zeros(1, GAIT_LOG)[0]
        self.samples = np.zeros(places)
        self.state = {"contact_forces_w": np.zeros((36, 3))} | {
            name: np.zeros(6) for name in ("adhesion", "retraction", "stumbling")
        }
        self.torques, self.velocities = np.zeros(42), np.zeros(42)
        self.tips_w = np.zeros((6, 3))
        self.steps_per_sample = steps_per_sample

    def put_down(self, leg, force=5.0):
        self.state["contact_forces_w"][6 * leg + 5] = (0.0, 0.0, force)

    def step(self, times=1):
        for _ in range(times):
            log_gait(
                self.log,
                self.samples,
                self.steps_per_sample,
                TIMESTEP,
                *self.state.values(),
                np.zeros(6),
                self.torques,
                self.velocities,
                self.tips_w,
            )


def test_a_leg_is_on_the_ground_when_the_sum_of_its_forces_is_above_the_threshold():
    forces_w = np.zeros((36, 3))
    forces_w[0] = (0.6, 0.0, 0.0)  # LF: 0.6 and 0.8 at right angles are 1, which is not above
    forces_w[5] = (0.0, 0.8, 0.0)
    forces_w[6] = (0.0, 0.0, 1.01 * CONTACT_THRESHOLD)  # LM
    forces_w[12:14] = [(0.0, 0.0, 3.0), (0.0, 0.0, -2.5)]  # LH: one pushes, one pulls
    is_grounded = np.full(6, np.nan)
    grounded_legs(forces_w, is_grounded)
    np.testing.assert_array_equal(is_grounded, [0, 1, 0, 0, 0, 0])


def test_many_flies_at_a_time_are_like_one_each():
    forces_w = np.random.default_rng(0).normal(0, 0.4, (20, 36, 3))
    expected, given = np.empty((20, 6)), np.empty((20, 6))
    for fly in range(20):
        grounded_legs(forces_w[fly], expected[fly])
    grounded_legs_of(forces_w, given)
    assert 0 < given.mean() < 1
    np.testing.assert_array_equal(given, expected)


def test_work_is_what_the_servos_do_not_what_is_done_on_them():
    fly = Fly()
    fly.torques[:3] = (2.0, -3.0, 4.0)
    fly.velocities[:3] = (10.0, -1.0, -5.0)
    fly.step(4)
    assert fly.log["work"] == pytest.approx(4 * (20 + 3) * TIMESTEP)


def test_slip_is_the_way_along_the_ground_of_tips_that_grip():
    fly = Fly()
    for leg in (1, 2):
        fly.put_down(leg)
    fly.state["adhesion"][[0, 2]] = 1.0
    fly.step()
    fly.tips_w[:] = (3.0, 4.0, 1.0)  # leg 2: 5 mm; leg 0 is in the air, leg 1 does not grip
    fly.step()
    fly.tips_w[:] = (3.0, 4.0, 7.0)  # up only
    fly.step()
    np.testing.assert_allclose(fly.log["slip"], [0, 0, 5, 0, 0, 0])


def test_a_step_through_the_air_is_no_slip():
    fly = Fly()
    fly.state["adhesion"][:] = 1.0
    fly.put_down(0)
    fly.step()
    fly.put_down(0, force=0.0)
    fly.tips_w[:] = 1.0
    fly.step()
    fly.put_down(0)
    fly.tips_w[:] = 2.0
    fly.step()
    assert not fly.log["slip"].any()


@pytest.mark.parametrize(
    ("name", "field"),
    [("adhesion", "adhesion"), ("retraction", "retraction"), ("stumbling", "stumbling")],
)
def test_samples_tell_what_a_leg_does(name, field):
    fly = Fly()
    fly.step()
    fly.state[field][4] = 1.0
    fly.step()
    rasters = unpack(fly.samples[:2].astype(np.uint32))
    for other in BITS:
        expected = np.zeros((2, 6), bool)
        expected[1, 4] = other == name
        np.testing.assert_array_equal(rasters[other], expected)


def test_samples_tell_which_legs_stand():
    fly = Fly(steps_per_sample=2)
    slow, fast = 0.9 * STANCE_SPEED * 2 * TIMESTEP, 1.1 * STANCE_SPEED * 2 * TIMESTEP
    for leg in ("LM", "RH"):
        fly.put_down(LEGS.index(leg))
    fly.step(2)
    fly.tips_w[LEGS.index("LM"), 0] = fast
    fly.tips_w[LEGS.index("RH"), 1] = slow
    fly.step(2)
    stance = unpack(fly.samples[:2].astype(np.uint32))["stance"]
    expected = [[leg in ("LM", "RH") for leg in LEGS], [leg == "RH" for leg in LEGS]]
    assert stance.tolist() == expected


def test_samples_come_every_so_many_steps_from_the_first_on():
    fly = Fly(steps_per_sample=3)
    fly.put_down(0)
    fly.step(2)
    assert fly.log["num_samples"] == 1
    fly.put_down(1)
    fly.step(2)
    assert fly.log["num_samples"] == 2
    assert fly.samples[:2].tolist() == [0b1, 0b11]


def test_new_samples_take_the_places_of_the_oldest():
    fly = Fly(places=3)
    for leg in range(5):
        fly.put_down(leg)
        fly.step()
    assert fly.samples.tolist() == [0b1111, 0b11111, 0b111]
