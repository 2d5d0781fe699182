"""Stop: standing within reach counts."""

import numpy as np
import pytest

from flyrl.tasks import TASKS
from tests.tasks.test_terms import fly_state, task_state

STOP = TASKS["stop"]()
REWARDS = {term.name: term for term in STOP.reward}


@pytest.mark.parametrize(
    ("x", "speed", "stood"),
    [(0.9, 1.9, 0.02), (1.1, 1.9, 0.0), (0.9, 2.1, 0.0), (0.9, -1.9, 0.02)],
)
def test_a_fly_stands_that_is_near_and_slow(x, speed, stood):
    before = fly_state(time=[0.5], position_w=[[x - 0.02 * speed, 0, 1]])
    state = task_state(fly_state(time=[0.52], position_w=[[x, 0, 1.3]]), before)
    np.testing.assert_allclose(REWARDS["standing"].compute(state), [stood])


def test_to_have_stood_for_long_enough_is_a_success_worth_as_much_however_long():
    total = sum([0.02] * 25)  # as the environment adds it up
    state = task_state(fly_state(2), standing=[total - 0.02, total])
    assert STOP.terminations[0].is_success
    assert STOP.terminations[0].holds(state).tolist() == [False, True]
    long = next(term for term in TASKS["stop"](kept=2.0).reward if term.name == "standing")
    assert long.weight * 2.0 == pytest.approx(REWARDS["standing"].weight * 0.5) == 2.0
