import os
import pickle
import resource
from pathlib import Path

import numpy as np
import pytest
import torch

from flyrl.training.run_folder import (
    checkpoint_file,
    load_checkpoint,
    load_latest_checkpoint,
    save_checkpoint,
)
from flyrl.training.runs import ResumeError, checkpoint_files
from tests.training.folders import same

VALUES = {
    "rows": np.arange(6.0).reshape(2, 3),
    "flags": np.array([True, False]),
    "generator": {"state": 2**127 + 1, "key": np.arange(3, dtype=np.uint32)},
    "scalar": np.float32(0.1),
    "nothing": None,
    "pair": (1, [2.5, "text"]),
}
STATE = {
    "learner": {"parameters": {"policy": {"weight": torch.ones(2, 3)}}, "attributes": {"n": 3}},
    "env": VALUES,
    "run": {"decisions": 3},
    "settings": {"seed": 0},
}


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    save_checkpoint(tmp_path / "c.pt", STATE)
    assert same(load_checkpoint(tmp_path / "c.pt"), STATE)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.9])
def test_a_truncated_checkpoint_is_an_error_that_names_it(tmp_path, share):
    path = tmp_path / "c.pt"
    save_checkpoint(path, {**STATE, "more": [np.full(1000, i) for i in range(60)]})
    os.truncate(path, round(share * path.stat().st_size))
    with pytest.raises(ResumeError, match=r"c\.pt is damaged"):
        load_checkpoint(path)


def test_a_number_that_changed_another_format_and_a_missing_part_are_errors(tmp_path):
    path = tmp_path / "c.pt"
    save_checkpoint(path, {**STATE, "more": np.full(1000, 7.0)})
    data = path.read_bytes()
    assert data.count(np.full(1000, 7.0).tobytes()) == 1
    path.write_bytes(data.replace(np.full(2, 7.0).tobytes(), np.full(2, 8.0).tobytes(), 1))
    with pytest.raises(ResumeError, match=r"c\.pt is damaged"):
        load_checkpoint(path)
    torch.save({"format": 99, "state": {}}, path)
    with pytest.raises(ResumeError, match="format 99"):
        load_checkpoint(path)
    for part in ("learner", "env", "run", "settings"):
        save_checkpoint(path, {key: value for key, value in STATE.items() if key != part})
        with pytest.raises(ResumeError, match=rf"c\.pt .*{part}"):
            load_checkpoint(path)


class _Touch:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_nothing_in_a_checkpoint_is_executed(tmp_path):
    path, trace = tmp_path / "c.pt", tmp_path / "executed"
    torch.save({"format": 2, "state": _Touch(trace)}, path)
    with pytest.raises(ResumeError):
        load_checkpoint(path)
    path.write_bytes(pickle.dumps(_Touch(trace)))
    with pytest.raises(ResumeError):
        load_checkpoint(path)
    assert not trace.exists()


def test_without_space_the_last_checkpoint_stays(tmp_path):
    path = tmp_path / "c.pt"
    save_checkpoint(path, STATE)
    good = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            save_checkpoint(path, STATE)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == good
    assert list(tmp_path.iterdir()) == [path]


def test_of_damaged_checkpoints_the_one_before_takes_the_place(tmp_path, capsys):
    paths = [checkpoint_file(tmp_path, decisions) for decisions in (1, 2, 3)]
    for i, path in enumerate(paths):
        save_checkpoint(path, {**STATE, "run": {"decisions": i}})
    for path in paths[1:]:
        path.write_bytes(path.read_bytes()[:-100])
    assert load_latest_checkpoint(tmp_path)["run"]["decisions"] == 0
    assert f"{paths[2]} cannot be read" in capsys.readouterr().err
    assert checkpoint_files(tmp_path) == paths[:1]
    paths[0].write_bytes(b"")
    with pytest.raises(ResumeError, match=r"0001\.pt is damaged"):
        load_latest_checkpoint(tmp_path)
