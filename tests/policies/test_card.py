import re
from dataclasses import replace

import pytest
from markdown_it import MarkdownIt

from flyrl.envs.core import EnvConfig
from flyrl.envs.record import env_record
from flyrl.policies.card import model_card
from flyrl.simulation.randomisation import RandomisationConfig

RATE = {"value": 0.5, "low": 0.25, "high": 0.75, "n": 4, "reason": None}


@pytest.fixture
def card(bundle):
    result = {
        "controller": "ppo",
        "success_rate": RATE,
        "metrics": {"time_to_goal_s": {"median": 1.234}, "return": {"median": -2.0}},
    }
    failing = {
        "controller": "zero",
        "success_rate": RATE | {"value": 0.0},
        "metrics": {"time_to_goal_s": {"median": None}, "return": {"median": 0.5}},
    }
    training = {
        "algo": "ppo",
        "decisions": 60000,
        "seed": 3,
        "command": "python train.py seed=3 | tee",
        "provenance": {
            "git": {"commit": "c0ffee", "is_dirty": False},
            "python": "3.11.7",
            "packages": {"mujoco": "4.0.0", "flyrl": None},
            "cpu": {"model": "A CPU"},
        },
        "held_out": {
            "episodes": 4,
            "seed": 1,
            "compared": ["success", "time_to_goal_s", "return"],
            "results": [result, failing],
        },
    }
    env = env_record(EnvConfig(terrain="random_mixed", physics="fast"))
    return model_card("target-mixed", replace(bundle, env=env, training=training))


@pytest.mark.parametrize(
    "line",
    [
        "# target-mixed",
        "| task | target |",
        "| decision interval, s | 0.02 |",
        "| terrain | random_mixed |",
        "| body | current |",
        "| leg controller | hybrid |",
        "| physics | fast, version 2 |",
        "| randomisation | none |",
        "| algorithm | ppo |",
        "| decisions | 60000 |",
        "| seed | 3 |",
        "| network | 3 → 2 → 2, relu |",
        r"| command | `python train.py seed=3 \| tee` |",
        "| commit | c0ffee |",
        "| versions | python 3.11.7, mujoco 4.0.0 |",
        "| CPU | A CPU |",
        "| who | success | 95 % interval | median time_to_goal_s | median return |",
        "| ppo | 50.0% | 25.0% to 75.0% | 1.23 | -2.00 |",
        "| zero | 0.0% | 25.0% to 75.0% | none | 0.50 |",
        "| bearing | 2 |",
        "Apache-2.0, as flyrl.",
    ],
)
def test_card_says_what_the_record_says(card, line):
    assert line in card.splitlines()


def test_whole_numbers_are_called_so(choosing):
    text = model_card("mine", choosing)
    assert "The action is 2 whole numbers, from [0, -1] to\n[2, 0]." in text


def test_physics_of_one_s_own_is_written_out(bundle):
    env = env_record(EnvConfig())
    env["physics"]["timestep"] = 0.00025
    text = model_card("mine", replace(bundle, env=env))
    assert "| physics | of its own: {'timestep': 0.00025, " in text


def test_what_was_randomised_is_written_as_typed(bundle):
    drawn = RandomisationConfig(friction=(0.5, 1.5), sensor_noise=0.1)
    env = env_record(EnvConfig(randomisation=drawn))
    text = model_card("mine", replace(bundle, env=env))
    assert "| randomisation | friction=[0.5, 1.5], sensor_noise=0.1 |" in text.splitlines()


def test_what_is_missing_is_said_to_be(bundle):
    text = model_card("mine", replace(bundle, env={}, training={}))
    for line in (
        "| task | not recorded |",
        "| randomisation | not recorded |",
        "| commit | not recorded |",
        "Figures are not recorded.",
    ):
        assert line in text.splitlines()


def elements(bundle, text):
    """Tags of the card of a policy whose record holds this text everywhere, as a page."""
    held_out = {"episodes": text, "seed": text, "compared": ["success"], "results": []}
    training = dict.fromkeys(("algo", "decisions", "seed", "command"), text)
    env = {key: {"name": text} for key in ("task", "terrain", "body", "controller")}
    record = replace(bundle, env=env, training=training | {"held_out": held_out})
    page = MarkdownIt("gfm-like", {"linkify": False}).render(model_card("a-policy", record))
    return set(re.findall("<[^>]*>", page))


@pytest.mark.parametrize(
    "text",
    [
        "<img src=x>",
        "[a](http://b.c)",
        "`",
        "a\n\n#### b",
        "**b**",
        "a | b",
        "![x](y)",
        "\\<b>",
        "`<b>`",
    ],
)
def test_no_text_of_a_record_is_markdown_or_html(bundle, text):
    assert elements(bundle, text) <= elements(bundle, "text")
