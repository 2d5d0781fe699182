"""What is read from a policy's memory."""

import numpy as np
import pytest

from benchmarks.memory import share_right


def test_what_is_there_is_read_and_what_is_not_is_guessed():
    """Guesses are right within four standard errors of one in six."""
    labels, rng = np.arange(240) % 6, np.random.default_rng(0)
    assert share_right(np.eye(6)[labels] + rng.normal(0, 0.1, (240, 6)), labels) == 1.0
    guessed = share_right(rng.normal(size=(240, 6)), labels)
    assert guessed == pytest.approx(1 / 6, abs=4 * np.sqrt(5 / 36 / 240))
