"""tools/publish_policy.py, and the policies that it put into assets/."""

import json
import shutil
import sys
from pathlib import Path

import pytest

from flyrl.policies import load_bundle, named_policies
from flyrl.policies.card import model_card
from flyrl.training.algorithms import AlgorithmConfig
from flyrl.training.config import ScheduleConfig, TrainingConfig
from flyrl.training.learn import train
from tests.policies.conftest import same_weights
from tests.tiny import TINY_ENV
from tools.publish_policy import check, main, publish


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A tiny run that claims to come from a commit, whatever state the checkout is in."""
    config = TrainingConfig(
        env=TINY_ENV,
        algo=AlgorithmConfig("ppo", n_steps=8, batch_size=16, n_epochs=1, hidden_layers=(8,)),
        training=ScheduleConfig(
            total_timesteps=32,
            num_envs=2,
            num_threads=1,
            evaluation_episodes=1,
            progress_bar=False,
        ),
    )
    folder = train(
        config, tmp_path_factory.mktemp("runs"), [sys.executable, "train.py", "seed=0"]
    ).folder
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
    assert training["command"] == f"{Path(sys.executable).name} train.py seed=0"
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


def test_policies_that_come_with_flyrl_are_small():
    assert all(path.stat().st_size <= 200_000 for path in named_policies().values())


def test_cards_that_come_with_flyrl_are_those_of_their_files():
    assert check() == 0
