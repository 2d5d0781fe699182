"""Results on disk: every bit comes back, and a stranger's files do no harm."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from flyrl.evaluation.episodes import episode_row, episode_table, episodes_digest
from flyrl.evaluation.results import (
    EPISODES_FILE,
    RESULTS_FILE,
    TRAJECTORIES_FILE,
    ResultsError,
    load_results,
    write_results,
)
from flyrl.files import file_digest
from tests.synthetic import make_record, make_results

ROWS = [
    episode_row(make_record([(0, 0), (1, 0)], index=i, outcome=outcome), "friction=2")
    for i, outcome in enumerate(("success", "fall"))
]


@pytest.fixture(scope="module")
def results():
    return make_results(controllers=("cpg", "hybrid"), episodes=3)


def lines(folder):
    """Lines of the table of episodes, as a spreadsheet reads them."""
    with (folder / EPISODES_FILE).open(newline="") as file:
        return list(csv.DictReader(file))


def test_what_was_written_is_read_back(results, tmp_path):
    path = write_results(results, tmp_path / "new")
    for loaded in (load_results(tmp_path / "new"), load_results(path)):
        assert_frame_equal(loaded.episodes, results.episodes, check_exact=True)
        assert loaded.protocol == results.protocol
        assert loaded.summaries == results.summaries
        assert loaded.drawn == results.drawn
        assert list(loaded.trajectories) == list(results.trajectories)
        for row, path in loaded.trajectories.items():
            np.testing.assert_equal(vars(path), vars(results.trajectories[row]))


def test_the_table_holds_every_digit_and_nothing_where_there_is_no_value(results, tmp_path):
    write_results(results, tmp_path)
    published = ["controller", "task", "terrain", "episode", "seed", "outcome", "success"]
    assert list(lines(tmp_path)[0])[:7] == published
    for row, (_, expected) in zip(lines(tmp_path), results.episodes.iterrows(), strict=True):
        assert float(row["return"]) == expected["return"]
        assert row["success"] == str(expected["success"])
        assert (row["time_to_goal_s"] == "") == np.isnan(expected["time_to_goal_s"])


def test_no_text_is_a_formula_in_a_spreadsheet(results, tmp_path):
    table = episode_table([{**ROWS[0], "controller": "=1+1", "return": -1.5}])
    write_results(replace(results, episodes=table), tmp_path)
    (row,) = lines(tmp_path)
    assert (row["controller"], row["return"]) == ("'=1+1", "-1.5")


def test_the_digest_is_that_of_the_table_and_changes_with_the_last_bit(results, tmp_path):
    write_results(results, tmp_path)
    assert episodes_digest(results.episodes) == file_digest(tmp_path / EPISODES_FILE)
    changed = {**ROWS[0], "return": np.nextafter(ROWS[0]["return"], 1).item()}
    assert episodes_digest(episode_table([changed])) != episodes_digest(episode_table(ROWS[:1]))


def test_a_table_takes_few_bytes_per_row():
    many = episode_table(ROWS * 5000)
    assert many.memory_usage(deep=True).sum() < 300 * len(many)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_metrics_that_are_not_finite_are_refused(value):
    with pytest.raises(ValueError, match=r"return must be finite or None.*episode 0 of cpg"):
        episode_table([{**ROWS[0], "return": value}])


def test_a_protocol_that_is_not_finite_is_not_written(results, tmp_path):
    broken = replace(results, protocol={**results.protocol, "horizon_s": float("inf")})
    with pytest.raises(ValueError, match="not JSON compliant: inf"):
        write_results(broken, tmp_path)
    assert not [path for path in tmp_path.iterdir() if path.name != "manifest.json"]


def test_a_crash_while_writing_leaves_the_old_files(results, tmp_path, monkeypatch):
    write_results(results, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def crash(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.fsync", crash)
    with pytest.raises(OSError, match="disk full"):
        write_results(make_results(controllers=("hybrid", "zero"), episodes=2), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


# ------------------------------------------------------------------ files of others


@pytest.fixture
def folder(results, tmp_path):
    write_results(results, tmp_path)
    return tmp_path


LONG = "a" * 1001


def load_changed(folder, change):
    """Load results whose results.json was changed in place."""
    contents = json.loads((folder / RESULTS_FILE).read_text())
    change(contents)
    (folder / RESULTS_FILE).write_text(json.dumps(contents))
    load_results(folder)


@pytest.mark.parametrize("name", [EPISODES_FILE, TRAJECTORIES_FILE])
def test_a_file_that_was_changed_does_not_belong_to_the_others(folder, name):
    path = folder / name
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ResultsError, match=f"{name}: it was changed since results.json"):
        load_results(folder)


def test_a_file_that_is_missing_is_named_but_for_the_paths(folder):
    (folder / TRAJECTORIES_FILE).unlink()
    assert load_results(folder).trajectories == {}
    for name in (EPISODES_FILE, RESULTS_FILE):
        (folder / name).unlink()
        with pytest.raises(ResultsError, match=f"{name}: no such file"):
            load_results(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "a list; expected an object"),
        ('{"schema": "flyrl.results/3"}', r"schema: 'flyrl\.results/3'; this version reads .*/4"),
        ("[" * 100_000, "recursion"),
    ],
)
def test_what_is_no_file_of_results(tmp_path, text, message):
    (tmp_path / RESULTS_FILE).write_text(text)
    with pytest.raises(ResultsError, match=rf"results\.json: .*{message}"):
        load_results(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("summary"), r"results\.summary: missing"),
        (lambda c: c.update(drawn=[]), r"results\.drawn: \[\]; expected dict"),
        (lambda c: c["protocol"].pop("seed"), r"protocol\.seed: missing"),
        (lambda c: c["protocol"].update(seed=True), r"protocol\.seed: True; expected int"),
        (lambda c: c["summary"][1].pop("paired"), r"summary\[1\]\.paired: missing"),
        (lambda c: c["summary"][0].update(controller=LONG), r"\[0\]\.controller: 'a*; expected"),
    ],
)
def test_what_breaks_the_schema_is_named(folder, change, message):
    with pytest.raises(ResultsError, match=message):
        load_changed(folder, change)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("return", "retrun", "column 'return' is missing"),
        (",drive_variation", ",drive_variation,way off", "a metric must be a word"),
        ("cpg,target,flat", "cpg,target,\u202etalf", r"terrain: '.u202etalf'; expected printable"),
        ("cpg,target,flat,0,", "cpg,target,flat,9999999999999999999,", ""),
        (",False,", ",no,", "success must be"),
        (",False,,", ",False,,inf,", ""),
    ],
)
def test_a_table_of_others_is_named_where_it_is_wrong(folder, before, after, message):
    path = folder / EPISODES_FILE
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))
    digest = {EPISODES_FILE: file_digest(path)}
    with pytest.raises(ResultsError, match=rf"episodes\.csv: .*{message}"):
        load_changed(folder, lambda contents: contents["files"].update(digest))
