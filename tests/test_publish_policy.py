"""tools/publish_policy.py, and the policies that it put into assets/."""

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.policies import load_bundle
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.training.learn import train
from tests.policies.conftest import same_weights, small_bundle
from tests.tiny import TINY
from tools.publish_policy import check, main, model_card, publish


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A tiny run that claims to come from a commit, whatever state the checkout is in."""
    folder = train(TINY, tmp_path_factory.mktemp("runs"), [sys.executable, "train.py"]).folder
    _set_git(folder, is_dirty=False)
    return folder


def _set_git(run, is_dirty):
    record = json.loads((run / "provenance.json").read_text())
    record["git"] = {"commit": "c0ffee", "is_dirty": is_dirty}
    (run / "provenance.json").write_text(json.dumps(record))


@pytest.fixture(scope="module")
def published(run, tmp_path_factory):
    """Folder that a policy was published into."""
    folder = tmp_path_factory.mktemp("policies")
    main([str(run), "target-flat", "--folder", str(folder), "--episodes", "1"])
    return folder


def test_published_policy_is_the_best_of_the_run(run, published):
    bundle, best = load_bundle(published / "target-flat.safetensors"), load_bundle(run)
    assert same_weights(bundle, best)
    assert bundle.env == best.env


def test_policy_file_records_where_it_comes_from(published):
    training = load_bundle(published / "target-flat.safetensors").training
    assert training["command"] == f"{Path(sys.executable).name} train.py"
    assert training["provenance"]["git"]["commit"] == "c0ffee"
    assert training["settings"]["algo"]["hidden_layers"] == [8]
    assert training["held_out"]["episodes"] == 1
    names = [row["controller"] for row in training["held_out"]["results"]]
    assert names == ["ppo", "cpg", "rule_based", "hybrid", "pursuit", "zero"]


def test_card_is_that_of_the_file(published):
    bundle = load_bundle(published / "target-flat.safetensors")
    text = (published / "target-flat.md").read_text(encoding="utf-8")
    assert text == model_card("target-flat", bundle)
    assert "| commit | c0ffee |" in text


def test_a_policy_that_is_too_large_is_refused_before_it_is_judged(run, tmp_path):
    large = tmp_path / "run"
    shutil.copytree(run, large)
    (large / "best.safetensors").write_bytes(bytes(200_001))
    with pytest.raises(ValueError, match="the policy has 200001 bytes; allowed: 200000"):
        publish(large, "large", tmp_path / "policies", 1, 1)
    assert not (tmp_path / "policies").exists()


def test_uncommitted_code_is_refused(run, tmp_path):
    _set_git(run, is_dirty=True)
    with pytest.raises(ValueError, match="ran code that is in no commit"):
        publish(run, "target-flat", tmp_path, episodes=1, num_threads=1)
    _set_git(run, is_dirty=False)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "target-flat"], "nowhere is not the folder of a run"),
        (["nowhere", "../target"], "name: '../target'; allowed: small letters and digits"),
        (["nowhere"], "name a run folder and the policy"),
    ],
)
def test_bad_arguments_are_refused(arguments, message, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert message in capsys.readouterr().err


def test_cards_that_come_with_flyrl_are_those_of_their_files():
    assert check() == 0


# ------------------------------------------------------------------ cards

RATE = {"value": 0.5, "low": 0.25, "high": 0.75, "n": 4, "reason": None}


@pytest.fixture
def card():
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
    return model_card("target-mixed", replace(small_bundle(), env=env, training=training))


LINES = {
    "# target-mixed",
    "| task | target |",
    "| decision interval, s | 0.02 |",
    "| terrain | random_mixed |",
    "| body | current |",
    "| leg controller | hybrid |",
    "| physics | fast, version 3 |",
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
}


def test_card_says_what_the_record_says(card):
    assert set(card.splitlines()) >= LINES


def test_physics_of_one_s_own_is_written_out():
    env = env_record(EnvConfig())
    env["physics"]["timestep"] = 0.00025
    text = model_card("mine", replace(small_bundle(), env=env))
    assert "| physics | of its own: {'timestep': 0.00025, " in text


def test_what_was_randomised_is_written_as_typed():
    drawn = RandomisationConfig((0.5, 1.5), sensor_noise=0.1, missing_leg=("LF", "RM"))
    env = env_record(EnvConfig(randomisation=drawn))
    text = model_card("mine", replace(small_bundle(), env=env))
    typed = "friction=[0.5, 1.5], sensor_noise=0.1, missing_leg=[LF, RM]"
    assert f"| randomisation | {typed} |" in text.splitlines()


def test_what_is_missing_is_said_to_be():
    text = model_card("mine", replace(small_bundle(), env={}, training={}))
    for line in (
        "| task | not recorded |",
        "| randomisation | not recorded |",
        "| commit | not recorded |",
        "Figures are not recorded.",
    ):
        assert line in text.splitlines()


def elements(text):
    """Tags of the card of a policy whose record holds this text everywhere, as a page."""
    held_out = {"episodes": text, "seed": text, "compared": ["success"], "results": []}
    training = dict.fromkeys(("algo", "decisions", "seed", "command"), text)
    env = {key: {"name": text} for key in ("task", "terrain", "body", "controller")}
    record = replace(small_bundle(), env=env, training=training | {"held_out": held_out})
    page = MarkdownIt("gfm-like", {"linkify": False}).render(model_card("a-policy", record))
    return set(re.findall("<[^>]*>", page))


@pytest.mark.parametrize(
    "text",
    ["<img src=x>", "[a](http://b.c)", "`", "a\n\n# b", "**b**", "a | b", "![x](y)", "`<b>`"],
)
def test_no_text_of_a_record_is_markdown_or_html(text):
    assert elements(text) <= elements("text")
