"""A task of a user's own in evaluations: its errors, its outcomes, and what decides it."""

import dataclasses

import numpy as np
import pytest

from flyrl.evaluation import EvaluationConfig, evaluate, load_results, write_results
from flyrl.evaluation.metrics import METRICS, check_metrics
from flyrl.evaluation.summary import find_leaders
from flyrl.report import write_report
from flyrl.tasks import TASKS, ErrorTerm, Task, Termination


def late(state):
    return state.fly.time > 0.15


def off(state):
    # the further along +x, the worse
    return np.abs(state.fly.position_w[:, 0]) + 1.0


def crawl_back() -> Task:
    """Stay where you are."""
    return dataclasses.replace(
        TASKS["hybrid_turning"](time_limit=0.2),
        errors=(ErrorTerm("way_off_mm", 50.0, off, "mm from where it began", 0.01),),
        terminations=(Termination("too_late", late),),
        decisive=("way_off_mm",),
        compared=("advance_mm",),
        decision_interval_s=0.02,
    )


@pytest.fixture(scope="module")
def results():
    config = EvaluationConfig(
        task=crawl_back, controllers=("cpg", "zero"), episodes=12, physics="fast", paths=0
    )
    return evaluate(config)


def test_its_error_is_a_metric(results):
    assert [*results.episodes.columns[-1:]] == ["way_off_mm"]
    # 7 or 8 of 10 decisions are walked, the others count 50
    assert (results.episodes["way_off_mm"] > 0.2 * 50).all()
    assert results.summaries[0]["metrics"]["way_off_mm"]["n"] == 12
    assert list(METRICS) == [*results.summaries[0]["metrics"]][:-1]
    # so is its outcome one of the outcomes
    assert set(results.episodes["outcome"]) == {"too_late"}
    assert "too_late" in results.protocol["outcomes"]


def test_it_is_decided_by_what_it_says(results):
    assert results.protocol["decisive"] == ["way_off_mm"]
    compared = ["success", "advance_mm", "way_off_mm", "return"]
    assert results.protocol["compared"] == compared
    assert results.protocol["smallest_effects"]["way_off_mm"] == 0.01
    (leader,) = find_leaders(results.episodes, results.protocol, np.random.default_rng(0))
    assert (leader.names, leader.metric) == (("zero",), "way_off_mm")
    (paired,) = (row["paired"] for row in results.summaries if row["paired"])
    assert list(paired["differences"]) == compared
    assert results.protocol["reference"] == "zero"


def test_results_and_report_hold_it(results, tmp_path):
    write_results(results, tmp_path)
    again = load_results(tmp_path)
    assert again.episodes.equals(results.episodes)
    text = write_report(again, tmp_path).read_text()
    assert "way off (mm)" in text
    assert "mm from where it began" in text
    assert "<dt>parameters</dt>" not in text  # it has none
    assert "way_off_mm_mean" in (tmp_path / "tables" / "summary.csv").read_text()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"decisive": ("way_of_mm",)}, "metric that decides .* 'way_of_mm'; did you mean 'way_off"),
        ({"errors": (ErrorTerm("return", 1.0, off, ""),)}, "must not have the name of the metric"),
    ],
)
def test_metrics_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        check_metrics(dataclasses.replace(crawl_back(), **changes))


@pytest.mark.parametrize("name", ["way off", 5])
def test_the_name_of_an_error_is_a_word(name):
    with pytest.raises(ValueError, match="name of an error term must be a word"):
        ErrorTerm(name, 1.0, off, "")
