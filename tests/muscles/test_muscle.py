"""Muscles: force and tension, and the neurons that a tension takes."""

import numpy as np
import pytest

from flyrl.muscles import MotorPool, Muscle
from flyrl.muscles.muscle import recruited

POOL = MotorPool([1.0, 2.0, 3.0, 4.0])
"""Of sum 10."""


def random_pool(seed):
    rng = np.random.default_rng(seed)
    forces = rng.exponential(size=rng.integers(1, 300))
    # some neurons have no force
    forces[rng.random(forces.size) < 0.3] = 0.0
    forces[rng.integers(forces.size)] = 1.0
    return MotorPool(forces)


def test_neurons_up_to_n_add_their_shares():
    muscle = Muscle(POOL, 20.0)
    n = np.array([[-5, 0, 1, 2], [3, 4, 10**6, 2]])
    expected = np.array([[0.1, 0.1, 0.3, 0.6], [1.0, 1.0, 1.0, 0.6]])
    np.testing.assert_allclose(muscle.tension(n), expected, rtol=1e-15)
    np.testing.assert_allclose(muscle.force(n.T), 20 * expected.T, rtol=1e-15)
    assert isinstance(muscle.tension(np.int64(2)), float)
    assert muscle.tension(np.uint64(2**64 - 1)) == 1.0


@pytest.mark.parametrize("seed", range(2))
def test_recruit_is_the_smallest_n_that_reaches_a_tension(seed):
    """And so is the engine's own."""
    muscle = Muscle(random_pool(seed))
    rng = np.random.default_rng(seed)
    wanted = np.concatenate([rng.random(50), muscle.pool.recruitment, [0.0, 1.0]])
    for tension, n in zip(wanted, muscle.recruit(wanted), strict=True):
        assert muscle.tension(n) >= tension
        assert n == 0 or muscle.tension(n - 1) < tension
        assert recruited(muscle.pool.recruitment, tension) == n


def test_recruit_by_hand():
    muscle = Muscle(MotorPool([1, 2, 3, 4, 0]), strength=7.0)
    wanted = [[0.05, 0.2, 0.5], [0.9, 1.0, -1.0], [-9e9, 1.5, 9e9]]
    assert muscle.recruit(wanted).tolist() == [[0, 1, 2], [3, 3, 0], [0, 3, 3]]
    assert isinstance(muscle.recruit(0.5), int)
    assert recruited(POOL.recruitment, np.nan) == 0


@pytest.mark.parametrize(
    ("call", "wrong", "message"),
    [
        (Muscle(POOL).force, [1.0, True, [1.5], [[1], [2, 3]], 10**30], "n must be whole numbers"),
        (Muscle(POOL).recruit, ["much", [0.1, np.nan]], "tension must be (numbers|finite)"),
        (lambda strength: Muscle(POOL, strength), [-1.0, np.inf], "strength must be a finite"),
    ],
)
def test_what_is_not_allowed_is_refused(call, wrong, message):
    for value in wrong:
        with pytest.raises(ValueError, match=message):
            call(value)
