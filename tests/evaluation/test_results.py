import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from flyrl.evaluation.results import (
    EPISODES_FILE,
    RESULTS_FILE,
    SCHEMA,
    TRAJECTORIES_FILE,
    ResultsError,
    load_results,
    validate,
    write_results,
)
from flyrl.evaluation.rows import ROW_KEYS
from tests.synthetic import make_results


@pytest.fixture(scope="module")
def results():
    return make_results(controllers=("cpg", "hybrid"), episodes=3)


@pytest.fixture
def contents(results):
    return json.loads(json.dumps(results.to_json()))


def test_results_have_the_published_form(results):
    contents = results.to_json()
    assert list(contents) == ["schema", "protocol", "drawn", "episodes", "summary"]
    assert contents["schema"] == SCHEMA == "flyrl.results/3"


def test_rows_begin_with_the_published_fields(results):
    assert list(results.episodes)[:7] == [
        "controller", "task", "terrain", "episode", "seed", "outcome", "success",
    ]  # fmt: skip
    published = {"return", "duration_s", "path_length_mm", "displacement_mm", "speed_mm_s"}
    assert published <= set(results.episodes)


def test_what_was_written_is_read_back(results, tmp_path):
    write_results(results, tmp_path / "new")
    loaded = load_results(tmp_path / "new")
    assert loaded.to_json() == results.to_json()


def test_a_file_is_as_good_as_its_folder(results, tmp_path):
    path = write_results(results, tmp_path)
    assert_frame_equal(load_results(path).episodes, results.episodes)


def test_paths_are_read_back_in_the_order_of_the_rows(results, tmp_path):
    write_results(results, tmp_path)
    loaded = load_results(tmp_path).trajectories
    assert list(loaded) == list(results.trajectories)
    for one, other in zip(loaded.values(), results.trajectories.values(), strict=True):
        np.testing.assert_array_equal(one.position_w, other.position_w)
        np.testing.assert_array_equal(one.drive, other.drive)


def test_paths_of_other_rows_are_left_out(results, tmp_path):
    write_results(results, tmp_path)
    stale = (tmp_path / TRAJECTORIES_FILE).read_bytes()
    write_results(make_results(controllers=("hybrid", "zero"), episodes=3), tmp_path)
    (tmp_path / TRAJECTORIES_FILE).write_bytes(stale)
    assert load_results(tmp_path).trajectories == {}


def test_results_are_read_without_paths(results, tmp_path):
    write_results(results, tmp_path)
    (tmp_path / TRAJECTORIES_FILE).unlink()
    assert load_results(tmp_path).trajectories == {}


def test_half_a_paths_file(results, tmp_path):
    write_results(results, tmp_path)
    path = tmp_path / TRAJECTORIES_FILE
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ResultsError, match=TRAJECTORIES_FILE):
        load_results(tmp_path)


def test_the_table_has_a_line_per_episode(results, tmp_path):
    write_results(results, tmp_path)
    with (tmp_path / EPISODES_FILE).open(newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(results.episodes)
    assert list(table[0]) == list(ROW_KEYS)
    assert [float(line["return"]) for line in table] == list(results.episodes["return"])


def test_null_is_an_empty_cell(results, tmp_path):
    write_results(results, tmp_path)
    with (tmp_path / EPISODES_FILE).open(newline="") as file:
        table = list(csv.DictReader(file))
    missing = [line["time_to_goal_s"] == "" for line in table]
    assert missing == list(results.episodes["time_to_goal_s"].isna())
    assert any(missing)


def test_a_crash_while_writing_leaves_the_old_files(results, tmp_path, monkeypatch):
    write_results(results, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def crash(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.fsync", crash)
    with pytest.raises(OSError, match="disk full"):
        write_results(make_results(controllers=("hybrid", "zero"), episodes=2), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_results_that_break_the_schema_are_not_written(results, tmp_path):
    write_results(results, tmp_path)
    broken = make_results(controllers=("cpg", "hybrid"), episodes=2)
    broken.episodes["outcome"] = "vanished"
    with pytest.raises(ResultsError, match="vanished"):
        write_results(broken, tmp_path)
    assert_frame_equal(load_results(tmp_path).episodes, results.episodes)


def test_numbers_that_are_not_finite_are_refused(results, tmp_path):
    broken = replace(results, protocol={**results.protocol, "horizon_s": float("inf")})
    with pytest.raises(ResultsError, match="not JSON compliant: inf"):
        write_results(broken, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_no_file(tmp_path):
    with pytest.raises(ResultsError, match="no such file"):
        load_results(tmp_path)


def test_half_a_file(results, tmp_path):
    path = write_results(results, tmp_path)
    path.write_text(path.read_text()[:1000])
    with pytest.raises(ResultsError, match="not JSON"):
        load_results(tmp_path)


def test_a_foreign_file_names_itself_and_what_is_expected(tmp_path):
    (tmp_path / RESULTS_FILE).write_text('{"schema": "flyrl.results/2"}')
    with pytest.raises(ResultsError, match=r"results\.json: schema: 'flyrl\.results/2'.*/3"):
        load_results(tmp_path)


def test_not_even_an_object():
    with pytest.raises(ResultsError, match="list"):
        validate([])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("summary"), r"results\.summary: missing"),
        (lambda c: c["protocol"].pop("seed"), r"protocol\.seed: missing"),
        (lambda c: c["protocol"].update(seed="1"), r"protocol\.seed: '1'; expected int"),
        (lambda c: c["episodes"][2].pop("return"), r"episodes\[2\]\.return: missing"),
        (lambda c: c["episodes"][0].update(success=1), r"episodes\[0\]\.success: 1; expected bool"),
        (lambda c: c["episodes"][0].update(seed=True), r"episodes\[0\]\.seed: True; expected int"),
        (lambda c: c["episodes"][1].update(outcome="won"), r"episodes\[1\]\.outcome: 'won'"),
        (lambda c: c["summary"][1].pop("paired"), r"summary\[1\]\.paired: missing"),
        (
            lambda c: c["episodes"][1].update(terrain="\u202etalf"),
            r"episodes\[1\]\.terrain: '.u202etalf'; expected printable text",
        ),
        (
            lambda c: c["summary"][0].update(controller="a" * 1001),
            r"summary\[0\]\.controller: 'a*; expected printable text of at most 1000",
        ),
        (lambda c: c.update(episodes={}), r"results\.episodes: \{\}; expected list"),
    ],
)
def test_what_breaks_the_schema_is_named(contents, change, message):
    change(contents)
    with pytest.raises(ResultsError, match=message):
        validate(contents)
