import csv
import json

import yaml

from flyrl.training.config import TrainingConfig, training_record
from flyrl.training.run_folder import RunFolder


def test_what_a_new_folder_says(tmp_path):
    config = TrainingConfig(seed=3)
    folder = RunFolder.create(config, tmp_path / "runs", ["python", "train.py", "a=[1, 2]"])
    assert folder.path.name.endswith("_target_flat_ppo_3")
    assert yaml.safe_load((folder.path / "config.yaml").read_text()) == training_record(config)
    assert (folder.path / "command.txt").read_text() == "python train.py 'a=[1, 2]'\n"
    provenance = json.loads((folder.path / "provenance.json").read_text())
    assert provenance["packages"]["mujoco"].startswith("4.")
    assert provenance["num_cpus"] >= 1


def test_runs_of_the_same_second_get_their_own_folders(tmp_path):
    config = TrainingConfig()
    folders = {RunFolder.create(config, tmp_path).path for _ in range(3)}
    assert len(folders) == 3


def test_rows(tmp_path):
    RunFolder(tmp_path).write_rows("rows.csv", [{"a": 1, "b": 0.5}, {"a": 2, "b": 0.25}])
    with (tmp_path / "rows.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["a", "b"], ["1", "0.5"], ["2", "0.25"]]
