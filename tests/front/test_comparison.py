import csv
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
import yaml

from flyrl.cli.main import main
from flyrl.envs.core import EnvConfig
from flyrl.front.comparison import (
    earlier_run,
    group_runs,
    label,
    ranked,
    telling_keys,
)
from flyrl.training.config import TrainingConfig
from flyrl.training.run_folder import checkpoint_file, create_folder
from flyrl.training.runs import held, read_run
from tests.training.folders import make_run


def _run(folder, settings=None, **arguments):
    """A run folder with other settings than the default ones, by dotted key."""
    path = make_run(folder, **arguments) / "config.yaml"
    record = yaml.safe_load(path.read_text())
    for key, value in (settings or {}).items():
        *sections, name = key.split(".")
        section = record
        for part in sections:
            section = section[part]
        section[name] = value
    path.write_text(yaml.safe_dump(record))
    return folder


def _groups(*folders):
    return group_runs([read_run(folder) for folder in folders])


def _labels(groups):
    return [label(group, telling_keys(groups)) for group in groups]


def _rows(folder):
    with (folder / "comparison.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def _compared(folder, *runs):
    """Rows of the table that `flyrl sweep` writes to a folder."""
    assert main(["sweep", *map(str, runs), "--output", str(folder)]) == 0
    return _rows(folder)


def _texts(folder):
    svg = ET.parse(folder / "learning_curves.svg")
    return [text.text for text in svg.iter("{http://www.w3.org/2000/svg}text")]


def test_five_seeds_have_an_interval_and_four_have_none(tmp_path):
    runs = [
        read_run(make_run(tmp_path / str(seed), seed=seed, evaluations=[(1, 1.0, 5.0), (2, s, 2)]))
        for seed, s in enumerate([0.5, 0.6, 0.7, 0.8, 0.9])
    ]
    ((_, row),), ((_, four),) = ranked(group_runs(runs)), ranked(group_runs(runs[:4]))
    assert (row["jobs"], row["runs"]) == (5, 5)
    assert row["final_success_mean"] == pytest.approx(0.7)
    # t(0.975, 4) = 2.776; standard error = sqrt(0.025 / 5)
    assert row["final_success_low"] == pytest.approx(0.7 - 2.776 * 0.0707107, abs=1e-4)
    assert row["final_success_high"] == pytest.approx(0.7 + 2.776 * 0.0707107, abs=1e-4)
    assert (row["best_success_mean"], row["best_success_low"]) == (1.0, None)
    assert (four["final_success_mean"], four["final_success_low"]) == (pytest.approx(0.65), None)


def test_a_sweep_is_printed_written_and_drawn(tmp_path, capsys):
    make_run(tmp_path / "a", evaluations=[(100, 0.5, 1.25)])
    make_run(tmp_path / "b", algo="sac", interrupted_by="SIGTERM")
    assert main(["sweep", str(tmp_path)]) == 0
    first, second = _rows(tmp_path)
    assert (first["algo"], first["final_success_mean"]) == ("ppo", "0.5")
    assert first["best_return_mean"] == "1.25"
    assert (second["runs"], second["final_success_mean"]) == ("0", "")
    output = capsys.readouterr().out
    assert "50.0%" in output
    assert "fewer than 5 runs, or equal ones, have no interval" in output
    assert {"target flat ppo", "algo=ppo, n = 1"} <= set(_texts(tmp_path))
    assert (tmp_path / "learning_curves.png").is_file()


def test_a_sweep_without_a_finished_run_can_be_written_elsewhere_without_a_figure(tmp_path):
    make_run(tmp_path / "sweep" / "a", interrupted_by="SIGTERM")
    rows = _compared(tmp_path / "a" / "b", tmp_path / "sweep")
    assert [row["runs"] for row in rows] == ["0"]
    assert [path.name for path in (tmp_path / "sweep").iterdir()] == ["a"]
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["comparison.csv"]


def test_sweeps_and_single_runs_are_compared_as_one_sweep(tmp_path, capsys):
    for seed, success in enumerate([0.25, 0.5]):
        rows = [(100, success, 1.0)]
        make_run(tmp_path / "A" / f"run{seed}", seed=seed, evaluations=rows)
        make_run(tmp_path / "B" / f"run{seed}", seed=seed, evaluations=rows, algo="sac")
    single = make_run(tmp_path / "C", seed=2, evaluations=[(100, 0.75, 1.0)], algo="sac")
    damaged = make_run(tmp_path / "D")
    (damaged / "config.yaml").unlink()
    table = _compared(tmp_path / "out", tmp_path / "A", tmp_path / "B", single, damaged)
    assert f"left out: {damaged}: config.yaml is missing\n" in capsys.readouterr().err
    keys = ("algo", "runs", "final_success_mean")
    rows = [tuple(row[key] for key in keys) for row in table]
    assert rows == [("sac", "3", "0.5"), ("ppo", "2", "0.375")]
    assert list(table[0])[:2] == ["algo", "jobs"]
    texts = set(_texts(tmp_path / "out"))
    assert {"target flat", "algo=ppo, n = 2", "algo=sac, n = 3"} <= texts


def _evaluated(folder, header, row, settings=None):
    """A run folder whose last evaluation has more columns."""
    _run(folder, settings, evaluations=[])
    header = f"decisions,success_rate,mean_return,mean_duration_s,{header}"
    (folder / "evaluations.csv").write_text(f"{header}\n{row}\n")
    return folder


def test_runs_of_one_reward_are_ranked_by_success_then_return(tmp_path):
    for name, success, return_ in (("a", 0.5, 1), ("b", 0.5, 2), ("c", 0.75, 0)):
        rate = {"algo.learning_rate": 0.1 * (1 + "abc".index(name))}
        _run(tmp_path / name, rate, evaluations=[(100, success, return_)])
    groups = _groups(*(tmp_path / name for name in "abc"))
    assert [group.runs[0].path.name for group, _ in ranked(groups)] == ["c", "b", "a"]


def test_runs_of_different_weights_show_unweighted_terms_and_no_return(tmp_path, capsys):
    weights = {"progress": 1.0, "success": 10.0}
    for name, row in (("a", "100,0.5,900,2,0,30"), ("b", "100,0.75,3,2,0,40")):
        more = {"task.weights": {**weights, "progress": 100.0 if name == "a" else 1.0}}
        _evaluated(tmp_path / name, "advance_mm,unweighted_progress", row, more)
    best, other = _compared(tmp_path / "out", tmp_path / "a", tmp_path / "b")
    assert (best["final_success_mean"], best["final_unweighted_progress_mean"]) == ("0.75", "40.0")
    assert other["final_success_mean"] == "0.5"
    assert not [column for column in best if "return" in column]
    assert "returns are not compared" in capsys.readouterr().out
    assert "held-out duration s" in _texts(tmp_path / "out")


def test_what_decides_a_task_ranks_its_runs(tmp_path):
    """The task velocity: of equal success, the least error of the speed."""
    for name, error in (("a", 2), ("b", 1)):
        more = {"task.name": "velocity", "algo.learning_rate": error / 100}
        _evaluated(tmp_path / name, "speed_error_mm_s", f"100,0.5,{error},2,{error}", more)
    groups = _groups(tmp_path / "a", tmp_path / "b")
    assert [group.runs[0].path.name for group, _ in ranked(groups)] == ["b", "a"]
    assert ranked(groups)[0][1]["final_speed_error_mm_s_mean"] == 1


def test_what_follows_from_the_name_of_the_algorithm_is_not_told(tmp_path):
    fast, slow = {"algo.learning_rate": 0.01}, {"algo.learning_rate": 0.001}
    folders = [
        _run(tmp_path / "a", fast),
        _run(tmp_path / "b", slow),
        _run(tmp_path / "c", {"algo.learning_rate": 0.1}, algo="sac"),
    ]
    settings = [group.settings for group in _groups(folders[0], folders[2])]
    assert settings == [{"algo": "ppo"}, {"algo": "sac"}]
    blocks = {"terrain.name": "blocks", "terrain.height_range": [0.2, 0.3]}
    random = {**blocks, "terrain.random": True}
    groups = _groups(_run(tmp_path / "d", blocks), _run(tmp_path / "e", random))
    assert [each.settings["terrain"] for each in groups] == ["blocks", "random_blocks"]
    assert _labels(_groups(*folders)) == [
        "algo=ppo algo.learning_rate=0.01",
        "algo=ppo algo.learning_rate=0.001",
        "algo=sac algo.learning_rate=0.1",
    ]


def test_what_differs_beside_the_labels_is_said_and_written(tmp_path, capsys):
    _run(tmp_path / "a")
    _run(tmp_path / "b", {"physics.timestep": 0.001}, algo="sac")
    rows = _compared(tmp_path / "out", tmp_path / "a", tmp_path / "b")
    assert "they differ also in physics.timestep: see " in capsys.readouterr().out
    assert [row["physics.timestep"] for row in rows] == ["0.0004", "0.001"]
    assert "algo=sac, n = 1" in _texts(tmp_path / "out")


def test_the_same_run_again_counts_once_the_finished_one(tmp_path):
    threads = {"training.num_threads": 7}
    folders = [
        _run(tmp_path / "a", interrupted_by="SIGTERM"),
        _run(tmp_path / "b", threads),
        _run(tmp_path / "c"),
    ]
    (group,) = _groups(*folders)
    assert group.jobs == 1
    assert [run.path.name for run in group.runs] == ["b"]


def test_settings_of_runs_are_plain_text_in_figures_and_no_formulas_in_spreadsheets(tmp_path):
    folders = [
        _run(tmp_path / "a", {"algo.name": "p\x1b[31mo"}),
        _run(tmp_path / "b", {"algo.name": "=1+1", "terrain.@x": -1.5}),
    ]
    assert "algo=p?[31mo" in [label.partition(" ")[0] for label in _labels(_groups(*folders))]
    rows = _compared(tmp_path / "out", *folders)
    assert {row["algo"] for row in rows} == {"p?[31mo", "'=1+1"}
    assert {row["terrain.@x"] for row in rows} == {"", "-1.5"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a", "a"], "error: several folders need --output, the folder to write to\n"),
        (["a", "b", "--output", "out"], "error: there is no run in b\n"),
    ],
)
def test_wrong_command_lines(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "a")
    (tmp_path / "b").mkdir()
    assert main(["sweep", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_sweep_knows_a_run_again_that_another_launcher_began(tmp_path):
    config = TrainingConfig(env=EnvConfig())
    here = replace(config.training, num_threads=1, progress_bar=False)
    run = create_folder(replace(config, training=here), tmp_path)
    assert earlier_run(config, tmp_path) is None  # nothing to resume from
    checkpoint_file(run, 64).write_text("")
    assert earlier_run(config, tmp_path, ["seed"]).path == run
    assert earlier_run(replace(config, seed=1), tmp_path) is None
    assert earlier_run(config, tmp_path, ["training.num_threads"]) is None
    with held(run), pytest.raises(ValueError, match="another process trains in"):
        earlier_run(config, tmp_path)
