import numpy as np
import pytest

from benchmarks.fidelity.drives import HIGH, HOLD_S, KINDS, LOW, sequence
from flyrl.tasks import DRIVE_HIGH, DRIVE_LOW


def test_a_seed_has_the_same_drives_whatever_their_number() -> None:
    for kind in KINDS:
        long, short = sequence(kind, 7, 1.5), sequence(kind, 7, 0.5)
        assert long.shape == (75, 2)
        np.testing.assert_array_equal(long[:25], short)
        assert not np.array_equal(long, sequence(kind, 8, 1.5))


def test_drives_fill_the_range_of_the_tasks_and_keep_within() -> None:
    assert (LOW, HIGH) == (DRIVE_LOW, DRIVE_HIGH)
    for kind in KINDS:
        drives = np.concatenate([sequence(kind, seed, 1.5) for seed in range(50)])
        assert LOW <= drives.min() < LOW + 0.05
        assert HIGH - 0.05 < drives.max() <= HIGH
    turns = np.array([sequence("turn", seed, 0.1)[0] for seed in range(40)])
    assert 10 < (turns[:, 0] < turns[:, 1]).sum() < 30
    assert turns.max(axis=1).min() >= 0.9
    assert turns.min(axis=1).max() <= 0.8


def test_a_turn_is_held_a_smooth_drive_changes_little_at_a_time_and_an_abrupt_one_jumps() -> None:
    turn, smooth, abrupt = (
        np.abs(np.diff([sequence(kind, k, 1.5) for k in range(9)], axis=1))
        for kind in ("turn", "smooth", "abrupt")
    )
    assert turn.max() == 0.0
    # a jump of two uniform numbers is a third of the range, in one pair of five
    assert abrupt.mean() == pytest.approx((HIGH - LOW) / 3 / 5, rel=0.2)
    assert 0 < smooth.max() < (HIGH - LOW) * 2 * np.pi * 2.0 * HOLD_S
