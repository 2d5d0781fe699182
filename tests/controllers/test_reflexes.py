"""The reflexes for a loop in Python; `test_controllers` holds the kernel to the specification."""

import numpy as np
import pytest

from flyrl.controllers import Hybrid, Reflexes

FORWARD = np.array([1.0, 0.0, 0.0])
LEVEL = np.full(6, -1.0)
LF_IN_HOLE = np.array([-2.0, -1.0, -1.0, -1.0, -1.0, -1.0])
NO_FORCE = np.zeros((36, 3))


def sensed(reflexes, heights=LEVEL):
    """How far the left front leg is retracted after one more step."""
    reflexes.step(0.0, heights, NO_FORCE, FORWARD)
    return reflexes.retraction[0]


@pytest.mark.parametrize(("timestep", "num_steps"), [(1e-4, 20), (3e-4, 7), (6e-4, 3), (1e-3, 2)])
def test_a_strongly_retracted_leg_persists_for_two_milliseconds(timestep, num_steps):
    reflexes = Reflexes(timestep, Hybrid())
    while sensed(reflexes, LF_IN_HOLE) <= 20:
        pass
    amounts = [sensed(reflexes, LF_IN_HOLE)]  # triggers, and is the first of the persisting steps
    while len(amounts) == 1 or amounts[-1] > amounts[-2]:
        amounts.append(sensed(reflexes))
    assert len(amounts) - 1 == num_steps


def test_amounts_handed_out_before_do_not_change():
    reflexes = Reflexes(1e-4, Hybrid())
    before = reflexes.retraction
    assert sensed(reflexes, LF_IN_HOLE) > 0
    assert not before.any()


@pytest.mark.parametrize(
    ("observation", "message"),
    [
        ((0.0, LEVEL[:5], NO_FORCE, FORWARD), r"end_effector_z must have shape \(6,\)"),
        ((np.nan, LEVEL, NO_FORCE, FORWARD), "thorax_z must be finite"),
    ],
)
def test_observations_are_checked(observation, message):
    with pytest.raises(ValueError, match=message):
        Reflexes(1e-4, Hybrid()).step(*observation)
