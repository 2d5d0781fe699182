"""The random stream in an array of doubles is NumPy's."""

import numpy as np
import pytest

from flyrl.controllers.random import legacy_choice, seeded_stream


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1])
def test_choices_are_those_of_random_state(seed):
    sizes = np.random.default_rng(seed).integers(1, 7, 5000)
    stream, random = seeded_stream(seed), np.random.RandomState(seed)
    actual = [legacy_choice(stream, int(size)) for size in sizes]  # many refills of the 624 words
    expected = [random.choice(list(range(size))) for size in sizes]
    assert actual == expected


@pytest.mark.parametrize("seed", [-1, 2**32, 0.5, True])
def test_seed_must_be_one(seed):
    with pytest.raises(ValueError, match="seed must be an integer from 0 to 2"):
        seeded_stream(seed)
