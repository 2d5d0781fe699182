import importlib.metadata
import json

import yaml

from flyrl.files import replacing
from flyrl.simulation.physics import PRESET_VERSIONS
from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.run_folder import checkpoint_file, create_folder, note_resumption
from flyrl.training.runs import read_run
from tests.training.folders import checkout, make_run


def test_what_a_new_folder_says(tmp_path):
    config = TrainingConfig(seed=3)
    folder = create_folder(config, tmp_path / "runs", ["python", "train.py", "a=[1, 2]"])
    assert folder.name.endswith("_target_flat_ppo_3")
    assert yaml.safe_load((folder / "config.yaml").read_text()) == training_record(config)
    assert (folder / "command.txt").read_text() == "python train.py 'a=[1, 2]'\n"
    provenance = json.loads((folder / "provenance.json").read_text())
    assert provenance["packages"]["mujoco"].startswith("4.")
    assert provenance["num_cpus"] >= 1
    version = PRESET_VERSIONS["balanced"]
    assert provenance["physics_preset"] == {"name": "balanced", "version": version}


def test_runs_of_the_same_second_get_their_own_folders(tmp_path):
    config = TrainingConfig()
    folders = {create_folder(config, tmp_path) for _ in range(3)}
    assert len(folders) == 3
    assert set(tmp_path.iterdir()) == folders  # nothing is left of where they were filled


def _interrupted(tmp_path, **changes):
    return make_run(tmp_path / "run", interrupted_by="SIGTERM", **changes)


def test_a_run_that_goes_on_says_where_and_warns_once_if_that_is_elsewhere(tmp_path, capsys):
    folder = _interrupted(tmp_path, provenance={"packages": {"numpy": "1.0"}})
    note_resumption(TrainingConfig(), folder, ["train.py", "resume=run"])
    version = importlib.metadata.version("numpy")
    assert f"\n  packages.numpy: 1.0, now {version}\n" in capsys.readouterr().err
    note_resumption(TrainingConfig(), folder)
    assert capsys.readouterr().err == ""
    record = json.loads((folder / "provenance.json").read_text())
    assert record["packages"] == {"numpy": "1.0"}
    assert [origin["packages"]["numpy"] for origin in record["resumed"]] == [version, version]
    assert (folder / "command.txt").read_text() == "train.py resume=run\n"


def test_a_run_that_goes_on_keeps_what_its_code_has_beyond_the_commit_now(tmp_path, monkeypatch):
    folder = _interrupted(tmp_path)
    package = checkout(tmp_path, b"a = 1\n")
    monkeypatch.setattr("flyrl.training.provenance._PACKAGE", package.parent)
    note_resumption(TrainingConfig(), folder)
    (tmp_path / "flyrl" / "__init__.py").write_bytes(b"a = 2\n")
    note_resumption(TrainingConfig(), folder)
    note_resumption(TrainingConfig(), folder)
    (changes,) = folder.glob("code*.diff")
    assert changes.name == "code_3.diff"
    assert changes.read_bytes().endswith(b"-a = 1\n+a = 2\n")


def test_a_run_that_goes_on_drops_what_a_kill_left_half_written(tmp_path):
    folder = _interrupted(tmp_path)
    left = []
    for path in (folder / "last.safetensors", checkpoint_file(folder, 100)):
        with replacing(path) as partial:
            partial.touch()
        left.append(partial)
        partial.touch()
    note_resumption(TrainingConfig(), folder)
    assert not any(path.exists() for path in left)


def test_how_far_a_run_came_is_not_what_an_interruption_before_said(tmp_path):
    folder = _interrupted(tmp_path, evaluations=[(100, 0.5, 1.0), (300, 0.5, 1.0)])
    assert read_run(folder).decisions == 200
    note_resumption(TrainingConfig(), folder)
    assert read_run(folder).decisions == 300
