"""Evaluations from Python: the bits of the command line, tables, reports, entrants of all kinds."""

import json
from functools import partial

import pandas as pd
import pytest

import flyrl
from flyrl.cli.config import evaluation_config, evaluation_settings
from flyrl.controllers import CPG
from flyrl.evaluation import measure_drive_map
from flyrl.evaluation.episodes import episodes_digest
from flyrl.front.results import training_evaluations
from flyrl.report import read_origin
from flyrl.training.learn import Run
from tests.training.folders import make_run

SHORT = {"physics": "fast", "episodes": 2, "progress_bar": False, "num_threads": 1}
SHORT |= {"task": {"name": "target", "time_limit": 0.4}}
NO_EXTRAS = {"videos": False, "close_ups": False}


def turning(time_s, observation):
    """To the left for a tenth of a second, then to the right."""
    return (0.4, 1.2) if time_s < 0.1 else (1.2, 0.4)


@pytest.fixture(scope="module")
def results():
    return flyrl.evaluate(["cpg", "target-flat", turning, "zero"], terrains=["flat"], **SHORT)


@pytest.mark.parametrize(
    ("given", "arguments"),
    [
        (
            {"entrants": ["cpg", "target-flat"], "terrains": ["flat", "blocks"], **SHORT},
            "policies=[target-flat] controllers=[cpg] terrains=[flat,blocks] episodes=2 "
            "task.time_limit=0.4",
        ),
        # without a time limit of its own, the task ends after the same time
        (
            {**SHORT, "entrants": "zero", "task": "hybrid_turning", "episodes": 1},
            "task=hybrid_turning controllers=[zero] episodes=1",
        ),
    ],
)
def test_python_and_command_line_walk_the_same_bits(run_here, tmp_path, given, arguments):
    ours = flyrl.evaluate(**given)
    short = "physics=fast progress_bar=false num_threads=1 folder=there"
    plain = ("videos=false", "close_ups=false")
    done = run_here("evaluate.py", *arguments.split(), *short.split(), *plain)
    assert done.returncode == 0, done.stderr
    theirs = flyrl.evaluation.load_results(tmp_path / "there")
    pd.testing.assert_frame_equal(ours.episodes, theirs.episodes)
    pd.testing.assert_frame_equal(ours.summary, theirs.summary)
    pd.testing.assert_frame_equal(ours.differences, theirs.differences)


def test_results_are_tables(results):
    assert len(results.episodes) == 4 * 2
    assert list(results.summary.controller) == ["target-flat", "turning", "cpg", "zero"]
    assert list(results.summary.episodes) == [2] * 4
    mean = results.episodes[results.episodes.controller == "cpg"].speed_mm_s.mean()
    cpg = results.summary.set_index("controller").loc["cpg"]
    assert cpg.speed_mm_s_mean == pytest.approx(mean)
    assert set(results.differences.reference) == {"cpg"}


def test_a_report_is_one_file(results, tmp_path):
    path = results.report(tmp_path / "new" / "mine.html", **NO_EXTRAS)
    assert path == tmp_path / "new" / "mine.html"
    assert [each.name for each in path.parent.iterdir()] == ["mine.html"]
    assert read_origin(path)["episodes_sha256"] == episodes_digest(results.episodes)


def test_settings_of_the_task_are_keywords():
    given = {**SHORT, "task": "target", "time_limit": 0.2, "distance": (4, 4), "bearing": 0}
    walked = flyrl.evaluate("zero", **given)
    named = {"name": "target", "time_limit": 0.2, "distance": (4, 4), "bearing": 0}
    again = flyrl.evaluate("zero", **{**SHORT, "task": named})
    pd.testing.assert_frame_equal(walked.episodes, again.episodes)
    assert walked.config.task == again.config.task


def test_drives_are_shown_on_flat_ground_where_the_grounds_differ(tmp_path, monkeypatch):
    coarse = partial(measure_drive_map, size=3, starts=2)
    monkeypatch.setattr("flyrl.front.results.measure_drive_map", coarse)
    walked = flyrl.evaluate("cpg", terrains="random_gapped", **SHORT)
    text = walked.report(tmp_path / "report.html", videos=False).read_text()
    assert "at constant drives on flat ground" in text


def test_what_a_report_holds_can_be_repeated(run_here, tmp_path):
    walked = flyrl.evaluate(
        ["zero", "target-flat"],
        terrains=["random_blocks"],
        vary={"friction": [1, 2]},
        film="contrast",
        **SHORT,
    )
    walked.report(tmp_path / "mine.html", **NO_EXTRAS)
    done = run_here("flyrl", "reproduce", "mine.html")
    assert done.returncode == 0, done.stderr
    assert "identical, bit for bit" in done.stdout


def test_a_function_that_fails_is_out_and_the_others_go_on(capsys):
    def late(time_s, observation):
        raise RuntimeError("not yet")

    walked = flyrl.evaluate([late, "zero"], **SHORT)
    assert not walked.is_complete
    assert list(walked.summary.controller) == ["zero"]
    assert "<td>zero</td>" in walked._repr_html_()
    crash = "late crashed on flat and is excluded there: RuntimeError: not yet"
    assert crash in walked._repr_html_()
    assert "warning: late crashed on flat" in capsys.readouterr().err


def test_things_of_ones_own_take_part_by_name(tmp_path):
    run = Run(make_run(tmp_path / "a"), None)
    own = ["tests.controllers.own:Wave", "tests.front.test_results:turning"]
    stairs = {"name": "examples.stairs:Stairs", "step_height": 0.1}
    walked = flyrl.evaluate([run, *own, "pursuit@cpg"], terrains=["flat", stairs], **SHORT)
    entrants = {each["name"]: each for each in walked.protocol["entrants"]}
    kinds = {name: each["kind"] for name, each in entrants.items()}
    assert kinds == {"ppo": "learned", "turning": "own", own[0]: "fixed", "pursuit@cpg": "fixed"}
    assert entrants["ppo"]["source"] == str(run.folder / "last.safetensors")
    assert entrants["pursuit@cpg"]["leg_controller"] == "cpg"
    assert list(dict.fromkeys(walked.summary.terrain)) == ["flat", "Stairs"]


def test_legs_with_settings_take_part_and_are_on_record():
    walked = flyrl.evaluate([CPG(gait="wave"), {"name": "cpg", "frequency_hz": 9}], **SHORT)
    assert set(walked.summary.controller) == {"cpg(gait=wave)", "cpg(frequency_hz=9.0)"}
    record = json.loads(json.dumps(walked.protocol["settings"]))
    config = evaluation_config(record, evaluation_settings(record), "")
    assert config.controllers == (CPG(gait="wave"), CPG(frequency_hz=9))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"entrants": "hybird"}, "no policy at hybird.*; did you mean 'hybrid'"),
        ({"entrants": "targt-flat"}, "did you mean 'target-flat'"),
        ({"distanc": (3, 5)}, "an evaluation has no setting 'distanc'; did you mean 'distance'"),
        ({"entrants": [{"name": "cpg", "gait": "wav"}]}, "gait must be one of .*mean 'wave'"),
        ({"entrants": {"gait": "wave"}}, "controller.name must be text, got None"),
        ({"entrants": [5]}, r"policies\[0\] must be text, a function"),
        ({"episods": 2}, "did you mean 'episodes'"),
        ({"terrains": ["flatt"]}, "did you mean 'flat'"),
        ({"task": "targt"}, "did you mean 'target'"),
        ({"controllers": ("cpg",)}, "no setting 'controllers'"),
        ({"entrants": lambda: 0}, r"function of \(time_s, observation\)"),
    ],
)
def test_what_cannot_be_evaluated_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        flyrl.evaluate(**given)


def test_learning_curves_are_those_of_run_folders(tmp_path):
    trained = make_run(tmp_path / "a", evaluations=((100, 0.5, 1.0), (200, 0.75, 2.0)))
    bare = make_run(tmp_path / "b", evaluations=())
    sources = {"a": trained / "last.safetensors", "b": bare / "last.safetensors"}
    sources["mine"] = tmp_path / "mine.safetensors"
    learned = [
        {"name": name, "kind": "learned", "source": str(file)} for name, file in sources.items()
    ]
    curves = training_evaluations([*learned, {"name": "cpg", "kind": "fixed", "source": None}])
    assert curves.keys() == {"a"}
    rows = [(row["decisions"], row["success_rate"], row["mean_return"]) for row in curves["a"]]
    assert rows == [(100, 0.5, 1), (200, 0.75, 2)]
