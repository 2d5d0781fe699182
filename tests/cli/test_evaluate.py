import json

import pytest

from flyrl.cli.arguments import check_arguments
from flyrl.cli.config import evaluation_config, evaluation_settings
from flyrl.evaluation import EvaluationConfig
from tests.tiny import TINY_ARGUMENTS

GROUPS = {"task": {"name": "target"}, "body": {}, "physics": {}}


def test_the_command_of_the_readme_is_fine():
    check_arguments(
        "evaluate",
        [
            "policies=[runs/a]",
            "controllers=[cpg,rule_based,hybrid]",
            "task=target",
            "terrains=[flat]",
            "episodes=50",
        ],
    )


def test_terrains_by_name_and_by_settings():
    random = {"name": "blocks", "height_range": [0.2, 0.3], "random": True}
    terrains = ["flat", {"name": "blocks", "height_range": [0.15, 0.45]}, random, "random_mixed"]
    config = evaluation_config(GROUPS, evaluation_settings({"terrains": terrains}, ""), "")
    labels = [terrain.label for terrain in config.terrain_configs]
    assert labels == ["flat", "blocks", "random_blocks", "random_mixed"]
    assert config.terrain_configs[1].height_range == (0.15, 0.45)


def test_defaults():
    assert evaluation_config(GROUPS, evaluation_settings({}, ""), "").episodes == 50
    assert EvaluationConfig().controllers == evaluation_settings({}, "").controllers


def test_decision_interval_is_refused():
    groups = {**GROUPS, "task": {"name": "target", "decision_interval": 0.01}}
    with pytest.raises(ValueError, match=r"task\.decision_interval must be null"):
        evaluation_config(groups, evaluation_settings({}, ""), "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["policies=[nowhere]"], "error: no policy at nowhere"),
        (["controllers=[cgp]"], "did you mean 'cpg'?"),
        (["terrains=flat"], "error: terrains must be a list, got 'flat'"),
        (["terrains=[flat,blokcs]"], "blocks"),
        (["folder=/proc/x"], "error: [Errno 2] No such file or directory: '/proc/x'"),
        (["episdes=3"], "error: there is no key 'episdes'; did you mean 'episodes'?"),
    ],
)
def test_wrong_command_lines_end_in_one_line(tmp_path, run_here, arguments, message):
    result = run_here("evaluate.py", *arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_train_then_evaluate_end_to_end(tmp_path, run_here):
    asked = ("evaluation.episodes=2", "evaluation.controllers=[zero]", "evaluation.videos=false")
    trained = run_here("train.py", "experiment=main", *asked, *TINY_ARGUMENTS, "video_after=false")
    assert trained.returncode == 0, trained.stderr
    *_, first, last = trained.stdout.splitlines()
    run = last.removeprefix("run: ")
    assert first == f"report: {run}/evaluation/report.html"
    assert (tmp_path / run / "evaluation" / "report.html").is_file()

    compared = run_here(
        "evaluate.py",
        f"policies=[{run}]",
        "controllers=[cpg,hybrid]",
        "task=target",
        "task.time_limit=0.5",
        "terrains=[flat]",
        "episodes=2",
        "videos=false",
    )
    assert compared.returncode == 0, compared.stderr
    report = tmp_path / compared.stdout.splitlines()[-1].removeprefix("report: ")
    results = json.loads((report.parent / "results.json").read_text())
    assert results["protocol"]["horizon_s"] == 0.5
    assert {row["controller"] for row in results["episodes"]} == {"ppo", "cpg", "hybrid"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["reports", "runs"]
