"""Muscles: force and tension, and the neurons that a tension takes."""

import numpy as np
import pytest

from flyrl.muscles import MotorPool, Muscle
from flyrl.muscles.muscle import recruited, tension_of

POOL = MotorPool([1.0, 2.0, 3.0, 4.0])
"""Of sum 10."""


def random_pool(seed):
    rng = np.random.default_rng(seed)
    forces = rng.exponential(size=rng.integers(1, 300))
    # some neurons have no force
    forces[rng.random(forces.size) < 0.3] = 0.0
    forces[rng.integers(forces.size)] = 1.0
    return MotorPool(forces)


@pytest.mark.parametrize(
    ("n", "tension"), [(-5, 0.1), (0, 0.1), (1, 0.3), (2, 0.6), (3, 1.0), (4, 1.0), (10**6, 1.0)]
)
def test_neurons_up_to_n_add_their_shares(n, tension):
    muscle = Muscle(POOL, 20.0)
    assert muscle.tension(n) == pytest.approx(tension, rel=1e-15)
    assert muscle.force(n) == pytest.approx(20 * tension, rel=1e-15)


@pytest.mark.parametrize("seed", range(2))
def test_recruit_is_the_smallest_n_that_reaches_a_tension(seed):
    muscle = Muscle(random_pool(seed))
    rng = np.random.default_rng(seed)
    wanted = np.concatenate([rng.random(50), muscle.pool.recruitment, [0.0, 1.0]])
    for tension, n in zip(wanted, muscle.recruit(wanted), strict=True):
        assert muscle.tension(n) >= tension
        assert n == 0 or muscle.tension(n - 1) < tension


def test_recruit_by_hand():
    muscle = Muscle(MotorPool([1, 2, 3, 4, 0]), strength=7.0)
    assert [muscle.recruit(t) for t in (0.05, 0.2, 0.5, 0.9, 1.0)] == [0, 1, 2, 3, 3]
    assert [muscle.recruit(t) for t in (-1.0, -np.inf, 1.5, np.inf)] == [0, 0, 3, 3]


def test_arrays_keep_their_shape():
    muscle = Muscle(POOL, 2.0)
    n = np.array([[0, 1, 2], [3, 9, -9]], dtype=np.int16)
    expected = [[0.1, 0.3, 0.6], [1.0, 1.0, 0.1]]
    np.testing.assert_allclose(muscle.tension(n), expected)
    np.testing.assert_allclose(muscle.force(n.T), 2 * np.transpose(expected))
    np.testing.assert_array_equal(muscle.recruit(expected), [[0, 1, 2], [3, 3, 0]])
    assert isinstance(muscle.tension(np.int64(2)), float)
    assert isinstance(muscle.recruit(0.5), int)


def test_unsigned_numbers_do_not_wrap():
    assert Muscle(POOL).tension(np.uint64(2**64 - 1)) == 1.0


@pytest.mark.parametrize(
    ("call", "wrong", "message"),
    [
        (Muscle(POOL).force, [1.0, True, [1.5], [[1], [2, 3]], 10**30], "n must be whole numbers"),
        (Muscle(POOL).recruit, ["much", [0.1, np.nan]], "tension must be numbers"),
        (lambda strength: Muscle(POOL, strength), [-1.0, np.inf], "strength must be a finite"),
    ],
)
def test_what_is_not_allowed_is_refused(call, wrong, message):
    for value in wrong:
        with pytest.raises(ValueError, match=message):
            call(value)


def test_kernels_and_class_are_the_same():
    muscle = Muscle(random_pool(3))
    table = muscle.pool.recruitment
    for n in range(-3, len(table) + 3):
        assert tension_of(table, n) == muscle.tension(n)
        assert recruited(table, tension_of(table, n)) == muscle.recruit(muscle.tension(n))


def test_what_is_no_number_recruits_the_first_neuron():
    assert recruited(POOL.recruitment, np.nan) == 0
