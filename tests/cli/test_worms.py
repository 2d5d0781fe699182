"""Worms from the command line: trained, resumed, evaluated and reported."""

import re
import signal

import pytest

from flyrl.evaluation import load_results
from flyrl.policies import load_policy
from flyrl.training.runs import read_run
from tests.tiny import TINY_ARGUMENTS
from tests.training.folders import interrupted_at

TINY = (
    "physics=worm",
    *(argument for argument in TINY_ARGUMENTS if argument != "physics=fast"),
    "video_after=false",
)
SHORT = ("task.time_limit=0.2", "episodes=2", "num_threads=1", "progress_bar=false", "folder=out")


@pytest.mark.slow
def test_a_worm_is_trained_resumed_and_compared_afterwards(tmp_path, run_here):
    with interrupted_at(3):
        given = ("task=worm_hang", *TINY, "training.progress_bar=true")
        interrupted = run_here("train.py", *given)
    assert interrupted.returncode == 128 + signal.SIGTERM
    run = interrupted.stdout.splitlines()[-1].removeprefix("run: ")
    assert f"interrupted; resume with: resume={run}" in interrupted.stderr
    assert read_run(tmp_path / run).state == "interrupted"
    assert (tmp_path / run / "learning_curve.svg").is_file()
    before = load_policy(tmp_path / run / "last.safetensors").bundle.training["decisions"]
    assert 32 <= before < 64

    short = ("evaluation.episodes=2", "evaluation.videos=false", "evaluation.close_ups=false")
    asked = (f"resume={run}", "video_after=false", "evaluate_after=true", *short)
    resumed = run_here("train.py", *asked)
    assert resumed.returncode == 0, resumed.stderr
    bundle = load_policy(tmp_path / run / "last.safetensors").bundle
    assert bundle.squashing == "argmax"
    assert bundle.action_high == (15.0,) * 8
    assert bundle.training["decisions"] == 64
    assert bundle.env["controller"] is None
    assert read_run(tmp_path / run).state == "finished"
    episodes = load_results(tmp_path / run / "evaluation").episodes
    assert episodes["controller"].tolist() == ["ppo"] * 2 + ["worm_reflex"] * 2 + ["relaxed"] * 2
    # one bar for all of it
    states = [state.strip() for state in resumed.stderr.split("\r") if "%|" in state]
    assert {state.split()[0] for state in states[1:]} == {"training", "evaluating", "reporting"}
    assert re.match(r"reporting +100%\|.*\[.*<00:00, .* parts/s\]", states[-1])


def test_a_report_of_worms_has_videos_and_curves_and_no_drive_map(tmp_path, run_here):
    result = run_here("evaluate.py", "task=worm_crawl", "controllers=[worm_cpg]", *SHORT)
    assert result.returncode == 0, result.stderr
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'id="drives"' not in page
    assert "tension of the first muscle" in page
    if "Videos are left out" in result.stderr:
        pytest.skip(result.stderr)
    assert page.count('src="data:video/mp4;base64,') == 1
