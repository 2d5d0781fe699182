import copy

import numpy as np
import pytest

from flyrl.evaluation.drive_map import Steering
from flyrl.report.html import format_report
from flyrl.report.setup import control_loop, trainings_section
from tests.report.test_html import Page
from tests.synthetic import make_results

TRAINING = {
    "algo": "ppo",
    "decisions": 102400,
    "seed": 7,
    "settings": {
        "algo": {"name": "ppo", "learning_rate": 0.0006, "hidden_layers": [64, 64]},
        "training": {"num_envs": 32},
    },
}

LEGGED = ("policy", "leg controller")


@pytest.fixture(scope="module")
def results():
    results = copy.deepcopy(make_results(("target-ppo", "cpg"), episodes=2, reference="cpg"))
    results.protocol["entrants"][0]["training"] = TRAINING
    for row in results.summaries:
        row["metrics"]["work_nj_per_mm"].update(n=2, mean=12.5, q1=11.0, q3=14.0)
    return results


@pytest.fixture(scope="module")
def page(results):
    bearings = np.array([-90.0, 0.0, 90.0])
    steering = Steering(bearings, {"target-ppo": np.ones((4, 3, 2))})
    return Page(format_report(results, steering=steering))


def test_the_task_is_told_with_its_weights_and_limits(page):
    text = " ".join(" ".join(page.texts).split())
    assert "success thorax within 1 mm of the target" in text
    assert "failure fall, left arena, unstable" in text
    assert "time limit 3 s" in text
    assert "progress 0.2 mm closer to the target" in text
    assert "target_direction 2 cos and sin of the target's bearing" in text


def test_gait_and_effort_have_a_table_of_the_metrics_that_somebody_has(results, page):
    headings = [attrs.get("title", "") for tag, attrs in page.tags if tag == "th"]
    assert sum("work of the servos" in text for text in headings) == 1
    assert not any("duty" in text or "leg stands" in text for text in headings)
    variation = results.summaries[0]["metrics"]["drive_variation"]["mean"]
    values = [attrs.get("data-value") for tag, attrs in page.tags if tag == "td"]
    assert "12.5" in values
    assert str(variation) in values


def test_trainings_are_told_with_their_settings(page):
    text = " ".join(" ".join(page.texts).split())
    settings = "learning_rate 0.0006, hidden_layers [64, 64], num_envs 32"
    assert f"target-ppo ppo 102400 7 {settings}" in text


def test_drives_over_bearings_are_drawn(page):
    text = " ".join(" ".join(page.texts).split())
    assert "mean over 4 starts" in text
    assert "bearing (deg), left positive" in text


@pytest.mark.parametrize("training", [None, [], {"settings": 3}, {"settings": {"algo": "ppo"}}])
def test_a_policy_file_without_settings_is_said_to_have_none(training):
    (row,) = trainings_section([{"name": "a", "kind": "learned", "training": training}])
    assert row == {
        "name": "a",
        **dict.fromkeys(("algo", "decisions", "seed", "settings"), "not recorded"),
    }


def test_long_settings_are_cut():
    (row,) = trainings_section([{"name": "a", "kind": "learned", "training": {"algo": "x" * 9999}}])
    assert len(row["algo"]) < 500


def test_results_without_a_table_of_their_task_are_reported(results):
    old = copy.deepcopy(results)
    del old.protocol["table"]
    assert "Task and policies" in format_report(old)


@pytest.mark.parametrize(
    ("actions", "body", "names"),
    [
        ("drives", {}, [*LEGGED, "servos", "body and ground"]),
        ("drives", {"muscles": {}}, [*LEGGED, "servos", "body and ground"]),
        ("drives", {"muscles": {"strength": 1}}, [*LEGGED, "muscles", "body and ground"]),
        ("neurons", {}, ["policy", "muscles", "body and ground"]),
    ],
)  # fmt: skip
def test_the_loop_has_the_parts_of_the_body(actions, body, names):
    loop = control_loop({"table": {"actions": actions}, "body": body})
    assert [part.name for part in loop] == names
    assert [part.name for part in loop if part.is_learned] == ["policy"]
