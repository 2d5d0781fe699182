import csv
import io
import subprocess
import sys

import pytest

from flyrl.cli.main import main
from flyrl.training.runs import read_run
from tests.training.folders import COMMIT, make_run


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "runs"
    make_run(folder / "a", seed=3, evaluations=[(100, 0.75, 2.0), (200, 0.5, 1.0)])
    make_run(folder / "b", algo="sac", seed=1, interrupted_by="SIGTERM")
    make_run(folder / "sweeps" / "x" / "c", seed=2, evaluations=[])
    return folder


def _listed(capsys, *arguments):
    assert main(["runs", *map(str, arguments), "--csv"]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def test_what_the_list_says_of_a_run(runs, capsys):
    assert _listed(capsys, runs)[0] == {
        "name": "a",
        "task": "target",
        "terrain": "flat",
        "algo": "ppo",
        "seed": "3",
        "decisions": "200",
        "state": "finished",
        "best": "0.75",
        "last": "0.5",
        "time": "12.5",
        "commit": COMMIT[:7],
    }


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ([], ["a", "b", "sweeps/x/c"]),
        (["--algo", "sac"], ["b"]),
        (["--seed", "3", "--seed", "2"], ["a", "sweeps/x/c"]),
        (["--state", "interrupted"], ["b"]),
        (["--task", "path"], []),
        (["--sort", "seed"], ["b", "sweeps/x/c", "a"]),
        # what has no value comes last, either way
        (["--sort", "best"], ["b", "a", "sweeps/x/c"]),
        (["--sort", "best", "--reverse"], ["a", "b", "sweeps/x/c"]),
    ],
)
def test_filters_and_order(runs, capsys, options, names):
    assert [row["name"] for row in _listed(capsys, runs, *options)] == names


def test_the_table_is_for_people(runs, monkeypatch, capsys):
    monkeypatch.chdir(runs.parent)
    assert main(["runs"]) == 0
    head, first, *_ = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert head.split()[:3] == ["name", "task", "terrain"]
    assert first.split() == [
        *("a", "target", "flat", "ppo", "3", "200", "finished"),
        *("75.0%", "50.0%", "0:00:12", COMMIT[:7]),
    ]


def test_a_damaged_run_is_listed_with_what_is_wrong(runs, capsys):
    (runs / "a" / "config.yaml").write_text("a: [")
    row = _listed(capsys, runs)[0]
    assert row["state"] == "damaged"
    assert row["problems"].startswith("config.yaml cannot be read")


def test_control_characters_do_not_reach_the_terminal(runs, capsys):
    path = runs / "a" / "config.yaml"
    path.write_text(path.read_text().replace("name: ppo", r'name: "p\e[31mo"'))
    (runs / "a" / "status.json").write_text(r'{"decisions": "\u001b[2J"}')
    assert main(["runs", str(runs)]) == 0
    output = capsys.readouterr().out
    assert "\x1b" not in output
    assert "p?[31mo" in output
    assert read_run(runs / "a").problems[0].isprintable()


def test_names_of_runs_are_no_formulas_in_a_spreadsheet(tmp_path, capsys):
    for name in ("=1+1", "@\x1ba"):
        make_run(tmp_path / name)
    assert [row["name"] for row in _listed(capsys, tmp_path)] == ["'=1+1", "'@?a"]


def test_runs_of_the_same_name_are_told_apart(tmp_path, capsys):
    folders = [make_run(tmp_path / "x" / "a"), make_run(tmp_path / "y" / "a", seed=1)]
    assert [row["name"] for row in _listed(capsys, *folders)] == [*map(str, folders)]


def test_a_folder_that_is_not_there_is_an_error_in_one_line(tmp_path, capsys):
    assert main(["runs", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err == f"error: there is no folder {tmp_path / 'none'}\n"


def test_python_m_flyrl_lists_without_torch(runs):
    command = [sys.executable, "-X", "importtime", "-m", "flyrl", "runs", str(runs)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "interrupted" in done.stdout
    assert " torch\n" not in done.stderr
