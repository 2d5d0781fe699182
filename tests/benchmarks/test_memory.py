"""What is read from a policy's memory."""

import numpy as np
import pytest

from benchmarks.memory import share_right

LABELS = np.arange(240) % 6


def test_what_is_there_is_read():
    features = np.eye(6)[LABELS] + np.random.default_rng(0).normal(0, 0.1, (240, 6))
    assert share_right(features, LABELS) == 1.0


def test_what_is_not_there_is_guessed():
    """Within four standard errors of one in six."""
    features = np.random.default_rng(0).normal(size=(240, 6))
    assert share_right(features, LABELS) == pytest.approx(1 / 6, abs=4 * np.sqrt(5 / 36 / 240))
