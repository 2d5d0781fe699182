"""Texts of reports: they say no more than is known of the task, its body and the entrants."""

import re

import pytest

from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.report.html import format_report
from flyrl.report.wording import parameters_text
from tests.evaluation.test_worms import CRAWL, HANG
from tests.report.test_close_up import walked
from tests.report.test_html import Page
from tests.synthetic import make_results

OF_FLIES = re.compile(r"\b(walk\w*|legs?|gait|falls?|fly|flies|fallen|reflexes|servos)\b", re.I)


def shown(text):
    """What a reader sees of a page, without the names of controllers and files."""
    text = re.sub(r"<(script|style|pre|code)\b.*?</\1>", "", text, flags=re.DOTALL)
    return " ".join(" ".join(Page(text).texts).split())


@pytest.mark.parametrize("task", [CRAWL, HANG], ids=["crawl", "hang"])
def test_a_report_on_worms_does_not_speak_of_legs(task):
    config = EvaluationConfig(task=task, episodes=2, num_threads=1)
    results = evaluate(config)
    text = shown(format_report(results, examples=results.examples))
    assert OF_FLIES.findall(text) == []
    assert "Failures: unstable" in text
    assert "change of drive" not in text
    assert "goal" not in text.replace("time to goal", "")


def test_each_outcome_is_named_by_its_shape():
    text = shown(format_report(make_results(("cpg", "zero"), episodes=2, reference="cpg")))
    assert "filled dot: success; ring: time out; cross: fall; triangle: left arena" in text
    assert "Dark rings: goals." in text


def test_reflexes_are_explained_where_they_are_drawn():
    results = make_results(("cpg",), episodes=2, reference="cpg")
    without = walked("cpg")
    with_reflexes = walked("cpg")
    with_reflexes.gait.retraction[10:20, 2] = True
    for record, count in ((without, 0), (with_reflexes, 1)):
        text = shown(format_report(results, examples=[record]))
        assert text.count("its retraction reflex") == count
        assert "bars are stance" in text


def test_metrics_are_explained_that_somebody_has():
    text = shown(format_report(make_results(("cpg",), episodes=2, reference="cpg")))
    assert "displacement ÷ path length" in text  # path_efficiency
    assert "share of a stride that the leg stands" not in text  # duty_factor


def test_a_headline_starts_its_sentences_with_capitals():
    results = make_results(("target-ppo", "cpg"), episodes=6, reference="cpg")
    results.protocol["entrants"][0] |= {
        "policy": "learned with ppo on flat", "training": {"settings": {}}
    }  # fmt: skip
    text = shown(format_report(results))
    assert "Learned with ppo on flat: 1 training seed (" in text


def test_parameters_stand_as_one_would_type_them():
    protocol = {"parameters": {"distance": [3.0, 30.0], "reach": 1.0, "time_limit": 3.0}}
    assert parameters_text(protocol) == "distance=[3.0,30.0], reach=1.0"
    assert parameters_text({}) == ""  # results from before they were noted
