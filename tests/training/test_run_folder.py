import csv
import importlib.metadata
import json

import pytest
import yaml

from flyrl.files import replacing
from flyrl.simulation.physics import PRESET_VERSIONS
from flyrl.training.checkpoint import save_checkpoint
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.run_folder import RunFolder
from flyrl.training.runs import ResumeError, read_run
from tests.training.folders import checkout, make_run


def test_what_a_new_folder_says(tmp_path):
    config = TrainingConfig(seed=3)
    folder = RunFolder.create(config, tmp_path / "runs", ["python", "train.py", "a=[1, 2]"])
    assert folder.path.name.endswith("_target_flat_ppo_3")
    assert yaml.safe_load((folder.path / "config.yaml").read_text()) == training_record(config)
    assert (folder.path / "command.txt").read_text() == "python train.py 'a=[1, 2]'\n"
    provenance = json.loads((folder.path / "provenance.json").read_text())
    assert provenance["packages"]["mujoco"].startswith("4.")
    assert provenance["num_cpus"] >= 1
    version = PRESET_VERSIONS["balanced"]
    assert provenance["physics_preset"] == {"name": "balanced", "version": version}


def test_runs_of_the_same_second_get_their_own_folders(tmp_path):
    config = TrainingConfig()
    folders = {RunFolder.create(config, tmp_path).path for _ in range(3)}
    assert len(folders) == 3
    assert set(tmp_path.iterdir()) == folders  # nothing is left of where they were filled


def _interrupted(tmp_path, **changes):
    path = make_run(tmp_path / "run", interrupted_by="SIGTERM", **changes)
    return RunFolder.open(TrainingConfig(), path)


def test_a_run_that_goes_on_says_where_and_warns_once_if_that_is_elsewhere(tmp_path, capsys):
    folder = _interrupted(tmp_path, provenance={"packages": {"numpy": "1.0"}})
    folder.go_on(TrainingConfig(), ["train.py", "resume=run"])
    version = importlib.metadata.version("numpy")
    assert f"\n  packages.numpy: 1.0, now {version}\n" in capsys.readouterr().err
    folder.go_on(TrainingConfig())
    assert capsys.readouterr().err == ""
    record = json.loads((folder.path / "provenance.json").read_text())
    assert record["packages"] == {"numpy": "1.0"}
    assert [origin["packages"]["numpy"] for origin in record["resumed"]] == [version, version]
    assert (folder.path / "command.txt").read_text() == "train.py resume=run\n"


def test_a_run_that_goes_on_keeps_what_its_code_has_beyond_the_commit_now(tmp_path, monkeypatch):
    folder = _interrupted(tmp_path)
    package = checkout(tmp_path, b"a = 1\n")
    monkeypatch.setattr("flyrl.training.provenance._PACKAGE", package.parent)
    folder.go_on(TrainingConfig())
    (tmp_path / "flyrl" / "__init__.py").write_bytes(b"a = 2\n")
    folder.go_on(TrainingConfig())
    folder.go_on(TrainingConfig())
    (changes,) = folder.path.glob("code*.diff")
    assert changes.name == "code_3.diff"
    assert changes.read_bytes().endswith(b"-a = 1\n+a = 2\n")


def test_a_run_that_goes_on_drops_what_a_kill_left_half_written(tmp_path):
    folder = _interrupted(tmp_path)
    left = []
    for path in (folder.path / "last.safetensors", folder.checkpoint(100)):
        with replacing(path) as partial:
            partial.touch()
        left.append(partial)
        partial.touch()
    folder.go_on(TrainingConfig())
    assert not any(path.exists() for path in left)


def test_how_far_a_run_came_is_not_what_an_interruption_before_said(tmp_path):
    folder = _interrupted(tmp_path, evaluations=[(100, 0.5, 1.0), (300, 0.5, 1.0)])
    assert read_run(folder.path).decisions == 200
    folder.go_on(TrainingConfig())
    assert read_run(folder.path).decisions == 300


def test_of_damaged_checkpoints_the_one_before_takes_the_place(tmp_path, capsys):
    folder = RunFolder(tmp_path)
    paths = [folder.checkpoint(decisions) for decisions in (1, 2, 3)]
    for i, path in enumerate(paths):
        learner, run = {"parameters": {}}, {"decisions": i}
        save_checkpoint(path, {"learner": learner, "env": {}, "run": run, "settings": {}})
    for path in paths[1:]:
        path.write_bytes(path.read_bytes()[:-100])
    assert folder.load_latest_checkpoint()["run"]["decisions"] == 0
    assert f"{paths[2]} cannot be read" in capsys.readouterr().err
    assert folder.checkpoints() == paths[:1]
    paths[0].write_bytes(b"")
    with pytest.raises(ResumeError, match=r"0001\.pt is damaged"):
        folder.load_latest_checkpoint()


def test_rows(tmp_path):
    RunFolder(tmp_path).write_rows("rows.csv", [{"a": 1, "b": 0.5}, {"a": 2, "b": 0.25}])
    with (tmp_path / "rows.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["a", "b"], ["1", "0.5"], ["2", "0.25"]]
