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


def test_python_and_command_line_walk_the_same_bits(run_here, tmp_path):
    ours = flyrl.evaluate(["cpg", "target-flat"], terrains=["flat", "blocks"], **SHORT)
    done = run_here(
        "evaluate.py", "policies=[target-flat]", "controllers=[cpg]", "terrains=[flat,blocks]",
        "physics=fast", "episodes=2", "task.time_limit=0.4", "progress_bar=false",
        "num_threads=1", "videos=false", "close_ups=false", "folder=there",
    )  # fmt: skip
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
    path = results.report(tmp_path / "mine.html", **NO_EXTRAS)
    assert path == tmp_path / "mine.html"
    assert [each.name for each in tmp_path.iterdir()] == ["mine.html"]
    assert read_origin(path)["episodes_sha256"] == episodes_digest(results.episodes)


def test_a_report_makes_its_folder(results, tmp_path):
    assert results.report(tmp_path / "a" / "b" / "mine.html", **NO_EXTRAS).is_file()


def test_a_task_without_a_time_limit_ends_as_on_the_command_line(run_here, tmp_path):
    given = {"physics": "fast", "episodes": 1, "progress_bar": False, "num_threads": 1}
    ours = flyrl.evaluate(["zero"], "hybrid_turning", **given)
    done = run_here(
        "evaluate.py", "task=hybrid_turning", "controllers=[zero]", "physics=fast", "episodes=1",
        "progress_bar=false", "num_threads=1", "videos=false", "close_ups=false", "folder=there",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = flyrl.evaluation.load_results(tmp_path / "there")
    pd.testing.assert_frame_equal(ours.episodes, theirs.episodes)


def test_a_terrain_may_be_a_mapping():
    stairs = {"name": "examples.stairs:Stairs", "step_height": 0.1}
    walked = flyrl.evaluate("zero", terrains=["flat", stairs], **SHORT)
    assert list(walked.summary.terrain) == ["flat", "Stairs"]


def test_settings_of_the_task_are_keywords():
    given = {**SHORT, "task": "target", "time_limit": 0.2, "distance": (4, 4), "bearing": 0}
    walked = flyrl.evaluate("zero", **given)
    named = {"name": "target", "time_limit": 0.2, "distance": (4, 4), "bearing": 0}
    again = flyrl.evaluate("zero", **{**SHORT, "task": named})
    pd.testing.assert_frame_equal(walked.episodes, again.episodes)
    assert walked.config.task == again.config.task


def test_a_law_on_other_legs_takes_part_by_name():
    (entrant,) = flyrl.evaluate("pursuit@cpg", **SHORT).protocol["entrants"]
    assert (entrant["kind"], entrant["leg_controller"]) == ("fixed", "cpg")


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


def test_a_run_takes_part(tmp_path):
    run = Run(make_run(tmp_path / "a"), None)
    (entrant,) = flyrl.evaluate(run, **SHORT).protocol["entrants"]
    assert (entrant["name"], entrant["kind"]) == ("ppo", "learned")
    assert entrant["source"] == str(run.folder / "last.safetensors")


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


def test_things_of_ones_own_take_part_by_name():
    walked = flyrl.evaluate(
        ["tests.controllers.own:Wave", "tests.front.test_results:turning"], **SHORT
    )
    kinds = {each["name"]: each["kind"] for each in walked.protocol["entrants"]}
    assert kinds == {"turning": "own", "tests.controllers.own:Wave": "fixed"}


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
    elsewhere = tmp_path / "mine.safetensors"
    entrants = [
        {"name": "a", "kind": "learned", "source": str(trained / "last.safetensors")},
        {"name": "b", "kind": "learned", "source": str(bare / "last.safetensors")},
        {"name": "mine", "kind": "learned", "source": str(elsewhere)},
        {"name": "cpg", "kind": "fixed", "source": None},
    ]
    curves = training_evaluations(entrants)
    assert curves.keys() == {"a"}
    rows = [(row["decisions"], row["success_rate"], row["mean_return"]) for row in curves["a"]]
    assert rows == [(100, 0.5, 1), (200, 0.75, 2)]
