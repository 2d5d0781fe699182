"""The reflexes for a loop in Python; `test_controllers` holds the kernel to the specification."""

import numpy as np
import pytest

from flyrl.controllers import Hybrid, Reflexes

FORWARD = np.array([1.0, 0.0, 0.0])
CURRENT = Hybrid()
LEVEL = np.full(6, -1.0)
LF_IN_HOLE = np.array([-2.0, -1.0, -1.0, -1.0, -1.0, -1.0])
NO_FORCE = np.zeros((36, 3))
LF_PUSHED_BACK = np.zeros((36, 3))
LF_PUSHED_BACK[1, 0] = -1.5  # LFTarsus1


def run(reflexes, num_steps, heights=LEVEL, forces=NO_FORCE):
    for _ in range(num_steps):
        reflexes.step(0.0, heights, forces, FORWARD)
    return reflexes


def current(timestep=1e-4):
    return Reflexes(timestep, CURRENT)


@pytest.mark.parametrize(("timestep", "num_steps"), [(1e-4, 20), (3e-4, 7), (6e-4, 3), (1e-3, 2)])
def test_a_strongly_retracted_leg_persists_for_two_milliseconds(timestep, num_steps):
    reflexes = current(timestep)
    while reflexes.retraction[0] <= 20:
        run(reflexes, 1, LF_IN_HOLE)
    run(reflexes, 1, LF_IN_HOLE)  # triggers, and is the first of the persisting steps
    growing = 1
    before = reflexes.retraction[0]
    while run(reflexes, 1).retraction[0] > before:
        before = reflexes.retraction[0]
        growing += 1
    assert growing == num_steps


def test_amounts_handed_out_before_do_not_change():
    reflexes = current()
    before = reflexes.retraction
    run(reflexes, 1, LF_IN_HOLE)
    assert not before.any()
    assert reflexes.retraction.any()


@pytest.mark.parametrize(
    ("observation", "message"),
    [
        ((0.0, LEVEL[:5], NO_FORCE, FORWARD), r"end_effector_z must have shape \(6,\)"),
        ((np.nan, LEVEL, NO_FORCE, FORWARD), "thorax_z must be finite"),
    ],
)
def test_observations_are_checked(observation, message):
    with pytest.raises(ValueError, match=message):
        current().step(*observation)
