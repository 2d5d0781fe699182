"""MT19937 on an array of doubles, so that a random stream can live in a simulation's state.

The stream is that of `numpy.random.RandomState`, whose values NumPy has frozen. The array holds
the generator's 624 words and its position, integers below 2³², which doubles hold exactly.

Source: Matsumoto & Nishimura 1998, doi 10.1145/272991.272995.
"""

import numpy as np

from flyrl.controllers.compilation import kernel
from flyrl.validation import FloatArray, random_seed

NUM_WORDS = 624
STATE_SIZE = NUM_WORDS + 1
"""Length of a stream's array: the words, then the index of the next one to use."""

_SHIFT_OFFSET = 397
_UPPER_BIT = np.uint32(0x80000000)
_LOWER_BITS = np.uint32(0x7FFFFFFF)
_TWIST = np.uint32(0x9908B0DF)
_TEMPER_B = np.uint32(0x9D2C5680)
_TEMPER_C = np.uint32(0xEFC60000)
_ONE = np.uint32(1)
_SHIFTS = (np.uint32(11), np.uint32(7), np.uint32(15), np.uint32(18))


def seeded_stream(seed: int) -> FloatArray:
    """Array of shape (625,) that continues as `RandomState(seed)` would.

    Raises
    ------
    ValueError
        If the seed is not an integer of 0 … 2³² - 1.
    """
    legacy = np.random.RandomState(random_seed(seed)).get_state(legacy=False)["state"]
    stream = np.empty(STATE_SIZE)
    stream[:NUM_WORDS] = legacy["key"]
    stream[NUM_WORDS] = legacy["pos"]
    return stream


@kernel
def next_word(stream: FloatArray) -> int:
    """Advance a stream by one and return a uniform 32-bit integer."""
    position = int(stream[NUM_WORDS])
    if position >= NUM_WORDS:
        for i in range(NUM_WORDS):
            here = np.uint32(stream[i])
            after = np.uint32(stream[(i + 1) % NUM_WORDS])
            mixed = (here & _UPPER_BIT) | (after & _LOWER_BITS)
            word = np.uint32(stream[(i + _SHIFT_OFFSET) % NUM_WORDS]) ^ (mixed >> _ONE)
            if mixed & _ONE:
                word ^= _TWIST
            stream[i] = np.float64(word)
        position = 0
    stream[NUM_WORDS] = position + 1.0
    word = np.uint32(stream[position])
    word ^= word >> _SHIFTS[0]
    word ^= (word << _SHIFTS[1]) & _TEMPER_B
    word ^= (word << _SHIFTS[2]) & _TEMPER_C
    word ^= word >> _SHIFTS[3]
    return int(word)


@kernel
def legacy_choice(stream: FloatArray, num_options: int) -> int:
    """Index that `RandomState.choice(num_options)` draws; a single option costs no draw.

    Draws the fewest bits that can hold the largest index, again until they do not exceed it.
    """
    largest = num_options - 1
    if largest <= 0:
        return 0
    mask = 1
    while mask < largest:
        mask = 2 * mask + 1
    index = next_word(stream) & mask
    while index > largest:
        index = next_word(stream) & mask
    return index
