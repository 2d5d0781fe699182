"""The evaluation of a report, repeated from the report alone."""

import json
import shutil

import pytest

from flyrl.cli.main import main
from flyrl.report import read_origin


def changed(report, folder, before, after):
    """A copy of a report with another text in it."""
    text = report.read_text()
    assert before in text
    path = folder / "report.html"
    path.write_text(text.replace(before, after))
    return path


def test_the_same_episodes_come_to_the_same(report, tmp_path, capsys):
    assert main(["reproduce", str(report), "--output", str(tmp_path / "again")]) == 0
    output = capsys.readouterr().out
    assert "episodes: identical, bit for bit" in output
    assert "same policies and packages" in output
    again = read_origin(tmp_path / "again" / "report.html")
    assert again["episodes_sha256"] == read_origin(report)["episodes_sha256"]


def test_what_differs_is_told(report, tmp_path, capsys):
    for name in ("results.json", "episodes.csv", "trajectories.npz"):
        shutil.copy(report.parent / name, tmp_path)
    other = changed(report, tmp_path, '"seed": 0', '"seed": 7')
    other = changed(other, tmp_path, '"numba": "', '"numba": "0.0.')
    assert main(["reproduce", str(other)]) == 1
    output = capsys.readouterr().out
    assert "10 of 10 episodes differ" in output
    assert "cpg on flat, episode 0: seed" in output
    assert "numba: 0.0." in output


def test_code_that_a_report_names_is_not_run_without_trust(report, tmp_path, capsys):
    other = changed(report, tmp_path, '"policies": []', '"policies": ["this:steady"]')
    assert main(["reproduce", str(other)]) == 2
    assert "names code that would be run: this:steady" in capsys.readouterr().err


def test_a_report_without_its_digest_is_an_error_before_anything_walks(report, tmp_path, capsys):
    other = changed(report, tmp_path, '"episodes_sha256": "', '"episodes": "')
    assert main(["reproduce", str(other)]) == 2
    assert capsys.readouterr().err.endswith("'episodes_sha256' must be text, got None\n")


@pytest.mark.parametrize("text", ["", "<html></html>", json.dumps({"schema": "flyrl.report/1"})])
def test_what_is_no_report(tmp_path, capsys, text):
    path = tmp_path / "other.html"
    path.write_text(text)
    assert main(["reproduce", str(path)]) == 2
    assert "is no report of this version" in capsys.readouterr().err
