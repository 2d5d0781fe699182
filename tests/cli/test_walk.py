"""flyrl walk: the table and the video of a walk, and recordings from files."""

import numpy as np
import pandas as pd
import pytest

from flyrl import PreprogrammedSteps
from flyrl.anatomy import JOINTS
from flyrl.cli.main import main

SHORT = ["walk", "--seconds", "0.05"]
POSE = np.tile(PreprogrammedSteps().default_pose, (3, 1))


def test_a_walk_is_written_as_a_table(tmp_path, capsys):
    path = tmp_path / "walk.csv"
    assert main([*SHORT, "--controller", "cpg", "--drive", "1", "0.5", "--csv", str(path)]) == 0
    table = pd.read_csv(path)
    assert table.time_s.iloc[-1] == pytest.approx(0.05, abs=1e-3)
    assert (table.command_right.iloc[-1], table.command_left.iloc[-1]) == (0.5, 1.0)
    assert "mm along x" in capsys.readouterr().out


def test_parts_take_settings_in_braces(tmp_path):
    paths = [tmp_path / "wave.csv", tmp_path / "tripod.csv"]
    for gait, path in zip(("wave", "tripod"), paths, strict=True):
        legs = ["--controller", f"{{name: cpg, gait: {gait}}}", "--terrain", "{name: flat}"]
        assert main([*SHORT, *legs, "--csv", str(path)]) == 0
    wave, tripod = map(pd.read_csv, paths)
    assert not wave.equals(tripod)


def test_a_wrong_setting_in_braces_is_refused(capsys):
    assert main([*SHORT, "--controller", "{name: cpg, gait: wav}"]) == 2
    assert "controller.gait must be one of" in capsys.readouterr().err


def test_a_walk_is_drawn_and_written_by_kind(tmp_path, capsys):
    files = {"npz": tmp_path / "walk.npz", "plot": tmp_path / "walk.svg"}
    words = [word for kind, path in files.items() for word in (f"--{kind}", str(path))]
    assert main([*SHORT, *words]) == 0
    with np.load(files["npz"]) as arrays:
        assert arrays["joints"].shape == (64, 42)
    assert files["plot"].read_text().startswith("<?xml")
    assert main([*SHORT, "--csv", "walk.txt"]) == 2
    assert "--csv must name a file that ends in .csv" in capsys.readouterr().err


def test_a_video_that_is_no_mp4_is_refused_before_the_walk(capsys):
    assert main(["walk", "--seconds", "1e9", "--video", "walk.avi"]) == 2
    assert "--video must name a file that ends in .mp4" in capsys.readouterr().err


def test_an_option_that_a_recording_goes_without_is_named(tmp_path, capsys):
    np.savez(tmp_path / "own.npz", joints=POSE, adhesion=np.ones((3, 6)))
    joints = ["--joints", str(tmp_path / "own.npz"), "--rate-hz", "100"]
    assert main(["walk", *joints, "--seconds", "1"]) == 2
    assert "seconds must not be given with joints, got 1.0" in capsys.readouterr().err


def test_a_table_can_be_replayed(tmp_path, capsys):
    pd.DataFrame(POSE, columns=JOINTS).to_csv(tmp_path / "own.csv", index=False)
    np.savez(tmp_path / "own.npz", joints=POSE, adhesion=np.ones((3, 6)))
    said = []
    for name in ("own.csv", "own.npz"):
        assert main(["walk", "--joints", str(tmp_path / name), "--rate-hz", "100"]) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1]
    assert said[0].startswith("0.02 s")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("own.csv", b"a,b\n1,2\n", "there is no 'joint_LFCoxa'"),
        ("own.csv", b"", "is no CSV"),
        ("own.npz", b"no zip", "is no whole file of arrays"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path, capsys, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    assert main(["walk", "--joints", str(path), "--rate-hz", "100"]) == 2
    assert message in capsys.readouterr().err
