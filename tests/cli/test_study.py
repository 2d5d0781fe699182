import pytest

from flyrl.cli.study import score


def test_success_counts_first_and_equal_success_by_the_return():
    def of(success_rate, mean_return):
        return score({"success_rate": success_rate, "mean_return": mean_return}, 4)

    assert of(0.5, 0.0) == 0.5 + 0.5 / 4
    assert of(0.5, 1.0) == pytest.approx(0.5 + 0.75 / 4)  # atan(1) = pi / 4
    assert of(0.5, -1e6) < of(0.5, -1.0) < of(0.5, 2.0) < of(0.5, 1e6) < of(0.75, -1e6)


def test_returns_of_different_rewards_do_not_count():
    evaluation = {"success_rate": 0.5, "mean_return": 1e6}
    assert score(evaluation, 4, has_one_reward=False) == 0.5
