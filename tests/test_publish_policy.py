"""tools/publish_policy.py, and the policies that it put into assets/."""

import json
import re
import shlex
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markdown_it import MarkdownIt

from flyrl.bodies.fly import FLIES
from flyrl.cli.arguments import composed
from flyrl.cli.config import evaluation_config, evaluation_settings
from flyrl.envs.config import env_record
from flyrl.envs.core import EnvConfig
from flyrl.policies import load_bundle, named_policies
from flyrl.policies.bundle import policies_folder
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.training.learn import train
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


def test_published_policy_is_the_best_of_the_run_and_says_where_it_comes_from(run, published):
    bundle, best = load_bundle(published / "target-flat.safetensors"), load_bundle(run)
    np.testing.assert_equal(bundle.weights, best.weights)
    assert bundle.env == best.env
    training = bundle.training
    assert training["command"] == f"{Path(sys.executable).name} train.py"
    assert training["provenance"]["git"]["commit"] == "c0ffee"
    assert training["settings"]["algo"]["hidden_layers"] == [8]
    assert training["held_out"]["episodes"] == 1
    names = [row["controller"] for row in training["held_out"]["results"]]
    assert names == ["ppo", "cpg", "rule_based", "hybrid", "pursuit", "unhurried", "zero"]
    text = (published / "target-flat.md").read_text(encoding="utf-8")
    assert text == model_card("target-flat", bundle)
    assert "| commit | c0ffee |" in text
    assert re.findall(r"^\| (\S+) \| \d\S*%", text, re.MULTILINE) == ["target-flat", *names[1:]]


def test_a_policy_that_is_too_large_or_of_uncommitted_code_or_no_run_is_refused(run, tmp_path):
    changed, folder = shutil.copytree(run, tmp_path / "run"), tmp_path / "policies"
    (changed / "best.safetensors").write_bytes(bytes(200_001))
    with pytest.raises(ValueError, match="the policy has 200001 bytes; allowed: 200000"):
        publish(changed, "large", folder, episodes=1, num_threads=1)  # before it is judged
    _set_git(changed, is_dirty=True)
    with pytest.raises(ValueError, match="ran code that is in no commit"):
        publish(changed, "dirty", folder, episodes=1, num_threads=1)
    for arguments in (["nowhere", "target-flat"], [str(run), "../target"], ["nowhere"]):
        with pytest.raises(SystemExit, match="2"):
            main(arguments)
    assert not folder.exists()


def test_cards_that_come_with_flyrl_are_those_of_their_files():
    assert check() == 0


def in_common(record, other):
    """Keys and values of the first, as far as the second has the keys, at any depth."""
    return {
        key: in_common(value, other[key]) if isinstance(other[key], dict) and value else value
        for key, value in record.items()
        if key in other
    }


@pytest.mark.parametrize("name", [*named_policies()])
def test_the_command_on_a_card_evaluates_in_the_setting_of_training(name):
    bundle = load_bundle(name)
    card = model_card(name, bundle)
    (command,) = re.findall("^`(python evaluate.py .*)`$", card, re.MULTILINE)
    typed = composed("evaluate", shlex.split(command)[2:])
    config = evaluation_config(typed, evaluation_settings(typed), command)
    assert config.policies == (name,)
    assert config.episodes == bundle.training["held_out"]["episodes"]
    evaluated = env_record(config.env(config.terrains[0]))
    for group in ("task", "body", "terrain", "randomisation"):
        trained = bundle.env[group]
        assert in_common(evaluated[group], trained) == in_common(trained, evaluated[group]), group


# ------------------------------------------------------------------ cards


@pytest.fixture(scope="module")
def shipped():
    return load_bundle(policies_folder() / "target-flat.safetensors")


def test_physics_of_one_s_own_and_what_was_randomised_are_written_out(shipped):
    drawn = RandomisationConfig((0.5, 1.5), sensor_noise=0.1, missing_leg=("LF", "RM"))
    env = {**env_record(EnvConfig(randomisation=drawn)), "physics": {"timestep": 0.00025}}
    lines = model_card("mine", replace(shipped, env=env)).splitlines()
    assert "| physics | of its own: {'timestep': 0.00025} |" in lines
    assert (
        "| randomisation | friction=[0.5, 1.5], sensor_noise=0.1, missing_leg=[LF, RM] |" in lines
    )


@pytest.mark.parametrize(
    ("body", "typed"),
    [
        (replace(FLIES["current"], missing_legs=("LF",)), "body=current 'body.missing_legs=[LF]'"),
        (replace(FLIES["classic"], adhesion_gain=20.0), "body=classic body.adhesion_gain=20.0"),
        (FLIES["fly_muscles"], "body=fly_muscles"),
    ],
)
def test_a_body_is_typed_as_what_differs_from_the_nearest_one(shipped, body, typed):
    card = model_card("mine", replace(shipped, env=env_record(EnvConfig(body=body))))
    assert f"task=target {typed} 'terrains=[flat]'" in card


def test_a_card_says_which_settings_of_task_and_body_are_not_the_usual_ones(shipped):
    body = replace(FLIES["current"], missing_legs=("LF",))
    task = {"name": "stop", "reach": 0.5}
    lines = model_card("mine", replace(shipped, env=env_record(EnvConfig(task, body=body))))
    assert "| task | stop, reach=0.5 |" in lines.splitlines()
    assert "| body | current, missing_legs=[LF] |" in lines.splitlines()
    usual = model_card("mine", replace(shipped, env=env_record(EnvConfig("stop")))).splitlines()
    assert "| task | stop |" in usual
    assert "| body | current |" in usual


def elements(shipped, text):
    """Tags of the card of a policy whose record holds this text everywhere, as a page."""
    held_out = {"episodes": text, "seed": text, "compared": ["success"], "results": []}
    provenance = {"git": {"commit": text}, "python": text, "packages": {text: text}}
    training = dict.fromkeys(("algo", "decisions", "seed", "command"), text)
    training |= {"held_out": held_out, "provenance": {**provenance, "cpu": {"model": text}}}
    env = {key: {"name": text} for key in ("terrain", "body", "controller")}
    env = {**shipped.env, **env, "task": {"name": text, "decision_interval": text}}
    card = model_card("a-policy", replace(shipped, env=env, training=training))
    page = MarkdownIt("gfm-like", {"linkify": False}).render(card)
    return set(re.findall("<[^>]*>", page))


@pytest.mark.parametrize(
    "text",
    ["<img src=x>", "[a](http://b.c)", "`", "a\n\n# b", "**b**", "a | b", "![x](y)", "`<b>`"],
)
def test_no_text_of_a_record_is_markdown_or_html(shipped, text):
    assert elements(shipped, text) <= elements(shipped, "text")
