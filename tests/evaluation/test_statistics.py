import numpy as np
import pytest

from flyrl.evaluation.statistics import (
    MANY_PAIRS,
    Distribution,
    adjusted,
    distribution,
    effect_size,
    interquartile_mean,
    mean_over_runs,
    p_value,
    paired_difference,
    performance_profile,
    probability_of_improvement,
    success_rate,
)


@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    [
        # (p + z²/2n ± z sqrt(p(1-p)/n + z²/4n²)) / (1 + z²/n), z = 1.959964, by hand
        (8, 10, 0.49016, 0.94332),
        (0, 20, 0, 0.16113),
    ],
)
def test_a_success_rate_has_wilsons_interval(successes, n, low, high):
    rate = success_rate(successes, n)
    assert rate.value == successes / n
    assert (rate.low, rate.high) == pytest.approx((low, high), abs=1e-5)


def test_distribution_leaves_out_what_is_missing():
    assert distribution([1, None, 2, 3, None, 10]) == Distribution(4, 2.5, 4, 1.75, 4.75)
    assert distribution([None]) == Distribution(0, None, None, None, None)


@pytest.mark.parametrize(
    ("estimate", "values", "reason"),
    [
        (paired_difference, [], "no pairs"),
        (paired_difference, [1, 2, 3, 6], "4 pairs: an interval needs at least 5"),
        (paired_difference, [2.0] * 20, "all 20 differences are equal: nothing to resample"),
        (mean_over_runs, [], "no runs"),
        (mean_over_runs, [1, 2, 3, 4], "4 runs: an interval needs at least 5"),
        (mean_over_runs, [2] * 5, "all 5 values are equal"),
        (interquartile_mean, [[0, 9]] * 4, "4 runs: an interval needs 5"),
        (interquartile_mean, [[1.0, 2.0]] * 6, "all runs are equal"),
    ],
)
def test_too_little_for_an_interval_says_why(estimate, values, reason):
    random = () if estimate is mean_over_runs else (np.random.default_rng(0),)
    found = estimate(values, *random)
    assert found.value == (np.mean(values) if values else None)
    assert (found.low, found.high, found.reason) == (None, None, reason)


def test_too_little_for_anything_else():
    assert success_rate(0, 0).reason == "no episodes"
    assert p_value([1, 2, 3, 4], np.random.default_rng(0)) is None
    assert effect_size([1, 2, 3, 4]) is effect_size([2] * 9) is None


def test_a_mean_difference_has_a_95_percent_interval_that_follows_a_skew():
    # Student's goes from 0.797 to 1.121
    values = np.random.default_rng(0).gamma(2, 0.5, size=60)
    found = paired_difference(values, np.random.default_rng(1))
    assert (found.low, found.high) == pytest.approx((0.816, 1.131), abs=0.01)


def test_many_pairs_have_what_resampling_comes_to():
    values = np.random.default_rng(0).exponential(size=MANY_PAIRS + 1) - 0.9
    fewer, many = (
        paired_difference(values[:n], np.random.default_rng(1)) for n in (MANY_PAIRS, len(values))
    )
    width = fewer.high - fewer.low
    assert (many.low, many.high) == pytest.approx((fewer.low, fewer.high), abs=0.05 * width)
    values = np.random.default_rng(2).normal(0.03, size=MANY_PAIRS + 1)
    fewer, many = (p_value(values[:n], np.random.default_rng(1)) for n in (MANY_PAIRS, len(values)))
    assert 0.01 < fewer < 0.5
    assert many == pytest.approx(fewer, abs=0.03)


@pytest.mark.parametrize(("difference", "expected"), [(0.0, 1.0), (1.0, 0.0)])
def test_many_pairs_that_all_differ_by_as_much(difference, expected):
    values = np.full(MANY_PAIRS + 1, difference)
    assert p_value(values, np.random.default_rng(0)) == expected


def test_mean_over_runs_has_students_interval_within_its_bounds():
    # mean 3, standard error sqrt(2.5 / 5), t(0.975, 4) = 2.7764451
    interval = mean_over_runs([1, 2, 3, 4, 5], high=4.5)
    assert (interval.value, interval.high) == (3, 4.5)
    assert interval.low == pytest.approx(3 - 2.7764451 * 0.5**0.5)


def test_all_signs_are_tried_of_few_pairs():
    # of the 32 ways to set the signs of 1 ... 5, only all + and all - have a mean as far from 0
    assert p_value([1, 2, 3, 4, 5], np.random.default_rng(0)) == pytest.approx(2 / 32)
    # ties say nothing of a difference
    assert p_value([0.0] * 8, np.random.default_rng(0)) == 1


def test_p_values_are_corrected_for_their_number():
    # sorted p times 4 over their rank, from the largest down never more than the one above
    assert adjusted([0.01, 0.04, 0.03, 0.5]) == pytest.approx([0.04, 0.16 / 3, 0.16 / 3, 0.5])
    # a comparison without p-value is none of the family
    assert adjusted([0.02, None, 0.04]) == pytest.approx([0.04, None, 0.04])
    assert adjusted([None]) == [None]


def test_ties_are_half_an_improvement_and_effects_in_standard_deviations():
    share = probability_of_improvement([3, -1, 0, 0, 5, 2], np.random.default_rng(0))
    assert share.value == pytest.approx((3 + 2 * 0.5) / 6)
    assert share.low < share.value < share.high
    assert effect_size([1, 2, 3, 4, 5]) == pytest.approx(3 / np.sqrt(2.5))


def test_the_interquartile_mean_leaves_out_a_quarter_on_either_side():
    scores = np.array([[0, 9], [1, 2], [3, 4], [-50, 100]])
    mean = interquartile_mean(scores, np.random.default_rng(0))
    # of -50 0 | 1 2 3 4 | 9 100
    assert mean.value == 2.5


def test_the_interval_over_seeds_comes_from_resampling_within_each_place():
    scores = np.random.default_rng(0).normal([0, 0.2, 0.3, 0.5], 1, size=(20, 4))
    mean = interquartile_mean(scores, np.random.default_rng(1))
    assert (mean.value, mean.low, mean.high) == pytest.approx((0.327, 0.088, 0.579), abs=0.01)
    # places far apart: resampling over both at once would make the interval as wide as their gap
    scores = np.random.default_rng(0).normal([0, 100], 0.1, size=(10, 2))
    mean = interquartile_mean(scores, np.random.default_rng(0))
    assert mean.low < mean.value < mean.high < mean.low + 1


def test_a_profile_is_the_share_of_scores_at_or_above():
    scores = [[0.0, 0.5], [0.5, 1.0], [1.0, 1.0], [0.0, 0.0], [0.5, 0.5]]
    profile = performance_profile(scores, [0, 0.5, 0.75, 1.1], np.random.default_rng(0))
    assert [point.value for point in profile] == [1, 0.7, 0.3, 0]
    assert profile[1].low < 0.7 < profile[1].high
