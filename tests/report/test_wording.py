"""Texts of reports: they say no more than is known of the task, its body and the entrants."""

import re

import pytest

from flyrl.evaluation import EvaluationConfig, evaluate
from flyrl.evaluation.statistics import Interval
from flyrl.evaluation.summary import Leader
from flyrl.report import wording
from flyrl.report.html import format_report
from tests.evaluation.test_worms import CRAWL, HANG
from tests.report.conftest import Page
from tests.synthetic import make_results

OF_FLIES = re.compile(r"\b(walk\w*|legs?|gait|falls?|fly|flies|fallen|reflexes|servos)\b", re.I)


@pytest.mark.parametrize("task", [CRAWL, HANG], ids=["crawl", "hang"])
def test_a_report_on_worms_does_not_speak_of_legs(task):
    config = EvaluationConfig(task=task, episodes=2, num_threads=1)
    results = evaluate(config)
    text = format_report(results, examples=results.examples)
    loop = "policy, muscles, body and ground, and senses back to the policy"
    assert f'aria-label="Control loop: {loop}"' in text
    # without the names of controllers and files
    text = re.sub(r"<(script|style|pre|code)\b.*?</\1>", "", text, flags=re.DOTALL)
    words = Page(text).words
    assert OF_FLIES.findall(words) == []
    assert "Failures: unstable" in words
    assert "change of drive" not in words
    assert "goal" not in words.replace("time to goal", "")


def lead(terrain, *names, condition=""):
    return Leader(terrain, names, "success", 1.0, condition=condition)


@pytest.mark.parametrize(
    ("leaders", "count", "sentence"),
    [
        ([lead("flat", "a"), lead("mixed", "b")], 3, "a is best on flat; b is best on mixed."),
        (
            [lead("flat", "a", "b"), lead("blocks", "a"), lead("mixed", "a")],
            *(3, "a and b are level at the top on flat; a is best on blocks and mixed."),
        ),
        (
            [lead("flat", "a", "b"), lead("mixed", "b", "a")],
            *(3, "a and b are level at the top on flat and mixed."),
        ),
        ([lead("flat", "a", "b")], 2, "No meaningful difference between controllers on flat."),
        # a controller alone wins nothing
        ([lead("flat", "a"), lead("mixed", "a")], 1, "a on flat and mixed."),
    ],
)
def test_the_headline_says_who_wins_where(leaders, count, sentence):
    assert wording.headline(leaders, count) == sentence


def test_the_headline_says_how_often_other_conditions_agree():
    usual = [lead("blocks", "a", condition="push=0"), lead("flat", "a", "b", condition="push=0")]
    others = [
        lead("blocks", "a", "b", condition="push=8"),
        lead("blocks", "a", condition="push=4"),
        lead("flat", "b", "a", condition="push=8"),
    ]
    assert wording.changes_text([*others, *usual], usual) == (
        "Of the other conditions, the leaders are the same under 1 of 2 on blocks and 1 of 1 on "
        "flat."
    )
    assert wording.changes_text(usual, usual) == ""


def test_the_smallest_effects_in_force_are_named():
    effects = {"success": 0.05, "time_to_goal_s": 0.1, "recruited_share": 0}
    text = wording.effects_text({"smallest_effects": effects, "decisive": [*effects]})
    assert text == "5\u00a0% in success or 0.1\u00a0s in time to goal"
    assert wording.effects_text({"smallest_effects": {}, "decisive": [*effects]}) == ""


def test_training_seeds_are_counted_with_a_caution_at_one():
    entrant = {"kind": "learned", "policy": "learned with ppo", "training": {"settings": {}}}
    a, b, moved = ({**entrant, "name": name} for name in ("a", "b", "a@cpg"))
    note = "Learned with ppo: 2 training seeds."
    assert wording.training_note({"entrants": [a, b]}) == note
    assert "1 training seed (other seeds" in wording.training_note({"entrants": [a]})
    # put on other legs is not trained once more
    assert wording.training_note({"entrants": [moved, a, b]}).count("training seed") == 1


def test_nothing_is_claimed_of_an_unknown_training():
    known = {"name": "a", "kind": "learned", "training": {"settings": {"seed": 1}}}
    unknown = {"name": "b", "kind": "own"}
    assert wording.held_out_text({"entrants": [known, unknown]}) == (
        "As recorded, a trained in flyrl, on episodes of other seeds. Nothing is recorded of the "
        "episodes that b may know."
    )


def test_a_task_without_a_target_has_no_same_target():
    drawn = {"flat": [{"goal": [], "command": [1, 2]}]}
    assert wording.shared_text(drawn) == "same start, same command"


@pytest.mark.parametrize(
    ("metric", "difference", "cells"),
    [
        ("time_to_goal_s", (-0.25, -0.5, -0.125), "0.50|0.25|-0.25 [-0.50, -0.12]"),
        ("success", (0.25, 0.125, 0.5), "50.0\u00a0%|25.0\u00a0%|+25.0 [+12.5, +50.0]"),
    ],
)
def test_a_lead_is_shown_with_its_interval(metric, difference, cells):
    leader = Leader("flat", ("a",), metric, 0.5, "b", 0.25, Interval(*difference, 9))
    assert "|".join(wording.leader_cells(leader).values()) == cells.replace("-", "\u2212")


def test_rates_count_episodes_of_the_learned_policy_first(results):
    text = wording.rates(results.summaries, results.protocol)
    counts = [row["successes"] for row in results.summaries if row["controller"] == "target-ppo"]
    first, second = text.split(" and ", 1)
    assert first.startswith(f"target-ppo succeeds in {counts[0]} of 8 episodes on flat (")
    assert second.startswith(f"{counts[1]} of 8 episodes on gapped (")
    assert text.count("95\u00a0% interval") == 4
    assert "Best of the others is " in text
    fixed = make_results(("cpg", "pursuit"), episodes=4, reference="cpg")
    assert wording.rates(fixed.summaries, fixed.protocol).startswith("pursuit succeeds")


def test_numbers_are_short():
    told = {
        None: "\u2013", 0: "0", -3e-17: "0", 1.23456: "1.23", -12.3456: "\u221212.3", 0.5: "0.50",
        0.04567: "0.046", -0.0042: "\u22120.0042", 0.999: "1.00", 9.996: "10.0", 1234.5: "1234",
    }  # fmt: skip
    assert {value: wording.format_number(value) for value in told} == told


def test_only_what_is_above_zero_has_a_plus():
    texts = [wording.signed(value, 100) for value in (0.25, -0.25, 1e-17)]
    assert texts == ["+25.0", "\u221225.0", "0"]


def test_parameters_stand_as_one_would_type_them():
    protocol = {"parameters": {"distance": [3.0, 30.0], "reach": 1.0, "time_limit": 3.0}}
    assert wording.parameters_text(protocol) == "distance=[3.0,30.0], reach=1.0"
    assert wording.parameters_text({}) == ""  # results from before they were noted


@pytest.mark.parametrize(
    ("task", "metric", "values", "sentence"),
    [
        ("target", "success", [1, 0], "first in which a reaches the target and b does not."),
        ("path", "success", [1, 0], "first in which a succeeds and b does not."),
        (
            *("target", "success", [0, 1]),
            "first in which b reaches the target and a does not; "
            "the other way round there is none.",
        ),
        (
            *("target", "time_to_goal_s", [0.625, 1.5]),
            "one in which a and b differ most in time to goal, 0.62 against 1.50 s.",
        ),
        ("target", None, [], "first, since no learned policy differs from the reference here."),
    ],
)
def test_a_chosen_episode_says_why(task, metric, values, sentence):
    pair = {"controller": "a", "reference": "b", "metric": metric, "values": values}
    protocol = {"task": task, "film": {"flat": {"episode": 17, **(pair if metric else {})}}}
    assert wording.contrast_text(protocol, "flat") == f"Episode 17: the {sentence}"
    assert wording.contrast_text({"task": task}, "flat") == ""  # nothing was asked for
