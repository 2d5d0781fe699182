"""Figures of the controllers: their numbers, worked out by hand."""

import numpy as np
import pytest

from flyrl.anatomy import LEG_DOFS, LEGS, TRIPODS
from flyrl.controllers import PreprogrammedSteps
from flyrl.report import controller_figures as figures


def turns(table, name, reference):
    """By how much of a turn a phase leads another at the end, 0 to 1."""
    lead = table[f"phase_{name}"].iloc[-1] - table[f"phase_{reference}"].iloc[-1]
    return lead / (2 * np.pi) % 1


def test_three_oscillators_settle_a_third_of_a_turn_apart():
    table = figures.three_oscillators_plot().table
    assert len(table) == 10_001
    gap = turns(table, 2, 1)
    assert min(gap, 1 - gap) == pytest.approx(1 / 3, abs=0.01)
    last = [table[f"magnitude_{i}"].iloc[-1] for i in (1, 2, 3)]
    np.testing.assert_allclose(last, [1.0, 1.1, 1.2], atol=1e-3)


def test_in_a_turn_the_legs_of_the_two_sides_follow_their_own_drive():
    table = figures.turn_plot().table
    assert table["time_s"].is_monotonic_increasing
    before, after = table.iloc[1000], table.iloc[-1]
    for leg in LEGS:
        assert before[f"magnitude_{leg}"] == pytest.approx(1.0, abs=1e-3)
        drive = 1.2 if leg.startswith("L") else 0.2
        assert after[f"magnitude_{leg}"] == pytest.approx(drive, abs=1e-3)


def test_legs_of_a_tripod_swing_together():
    table = figures.tripod_plot().table
    leads = [turns(table, leg, "LF") for leg in LEGS]
    expected = [0.0 if leg in TRIPODS[0] else 0.5 for leg in LEGS]
    np.testing.assert_allclose((np.subtract(leads, expected) + 0.5) % 1, 0.5, atol=0.01)


def test_a_recorded_step_repeats_itself_and_grows_from_the_neutral_pose():
    table, ramped = figures.steps_plot().table, figures.steps_plot(ramps=True).table
    for recording in ("tethered", "untethered"):
        names = [f"{recording}_{leg}{dof}" for leg in LEGS for dof in LEG_DOFS]
        np.testing.assert_allclose(table[names].iloc[0], table[names].iloc[120], atol=1e-12)
        neutral = PreprogrammedSteps(recording).default_pose
        np.testing.assert_allclose(ramped[names].iloc[0], neutral)
        np.testing.assert_allclose(ramped[names].iloc[-1], table[names].iloc[-1])


def test_scores_of_the_rules_add_up_and_a_step_takes_as_long_as_the_recorded_one():
    rules = figures.rules_plot().table
    assert len(rules) == 1000
    for leg in LEGS:
        parts = sum(rules[f"rule{i}_scores_{leg}"] for i in (1, 2, 3))
        np.testing.assert_allclose(rules[f"combined_scores_{leg}"], parts)
        assert rules[f"leg_phases_{leg}"].max() > 6.0
    per_sample = np.diff(rules["leg_phases_LM"])
    assert np.median(per_sample[per_sample > 0]) * 1e3 == pytest.approx(2 * np.pi / 0.135)
