"""flyrl walk: the table and the video of a walk, and recordings from files."""

import numpy as np
import pandas as pd
import pytest

from flyrl import PreprogrammedSteps
from flyrl.anatomy import JOINTS
from flyrl.cli.main import main

SHORT = ["walk", "--seconds", "0.05"]
POSE = np.tile(PreprogrammedSteps().default_pose, (3, 1))


def test_a_walk_is_written_and_drawn_and_its_parts_take_settings_in_braces(tmp_path, capsys):
    for gait in ("wave", "tripod"):
        files = {kind: str(tmp_path / f"{gait}.{kind}") for kind in ("csv", "npz", "svg")}
        legs = ["--controller", f"{{name: cpg, gait: {gait}}}", "--drive", "1", "0.5"]
        outputs = ["--csv", files["csv"], "--npz", files["npz"], "--plot", files["svg"]]
        assert main([*SHORT, *legs, *outputs]) == 0
    wave, tripod = (pd.read_csv(tmp_path / f"{gait}.csv") for gait in ("wave", "tripod"))
    assert not wave.equals(tripod)
    assert tripod.time_s.iloc[-1] == pytest.approx(0.05, abs=1e-3)
    assert (tripod.command_right.iloc[-1], tripod.command_left.iloc[-1]) == (0.5, 1.0)
    assert "mm along x" in capsys.readouterr().out
    with np.load(tmp_path / "wave.npz") as arrays:
        assert arrays["joints"].shape == (64, 42)
    assert (tmp_path / "wave.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--controller", "{name: cpg", "is no YAML"),
        ("--controller", "{name: cpg, gait: wav}", "controller.gait must be one of"),
        ("--csv", "walk.txt", "--csv must name a file that ends in .csv"),
        ("--video", "walk.avi", "--video must name a file that ends in .mp4"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_the_walk(capsys, option, value, message):
    try:
        status = main(["walk", "--seconds", "1e9", option, value])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert message in capsys.readouterr().err


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
