"""The random stream in an array of doubles is NumPy's."""

import numpy as np
import pytest

from flyrl.controllers.random import legacy_choice, next_word, seeded_stream


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**32 - 1])
def test_words_are_those_of_mt19937(seed):
    stream = seeded_stream(seed)
    expected = np.random.RandomState(seed).randint(0, 2**32, 2000, dtype=np.uint32)
    actual = [next_word(stream) for _ in range(2000)]  # three refills of the 624 words
    assert actual == expected.tolist()


@pytest.mark.parametrize("seed", [0, 7])
def test_choices_are_those_of_random_state(seed):
    sizes = np.random.default_rng(seed).integers(1, 7, 5000)
    stream, random = seeded_stream(seed), np.random.RandomState(seed)
    actual = [legacy_choice(stream, int(size)) for size in sizes]
    expected = [random.choice(list(range(size))) for size in sizes]
    assert actual == expected


def test_a_single_option_costs_no_draw():
    stream = seeded_stream(0)
    before = stream.copy()
    assert legacy_choice(stream, 1) == 0
    np.testing.assert_array_equal(stream, before)


@pytest.mark.parametrize("seed", [-1, 2**32, 0.5, True])
def test_seed_must_be_one(seed):
    with pytest.raises(ValueError, match="seed must be an integer from 0 to 2"):
        seeded_stream(seed)
