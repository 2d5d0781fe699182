import json
import subprocess
import sys

import numpy as np
import pytest

from flyrl.anatomy import JOINTS, LEG_SEGMENTS, LEGS
from flyrl.resources import assets_folder

ASSETS = assets_folder()


def test_assets_are_small_and_hold_no_pickle():
    files = [path for path in ASSETS.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 3e6
    kinds = {".json", ".csv", ".npz", ".stl", ".png", ".md", ".safetensors", ""}
    assert {path.suffix for path in files} <= kinds
    for path in files:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                assert all(archive[key].dtype == np.float64 for key in archive.files)


def test_assets_say_where_they_come_from():
    notice = (ASSETS / "NOTICE").read_text(encoding="utf-8")
    for item in ("Apache License", "flygym 0.2.5", "flygym 1.2.1", "10.1038/s41592-024-02497-y"):
        assert item in notice


@pytest.mark.parametrize(
    ("name", "samples", "timestep", "duration", "swing", "stance", "neutral"),
    [
        (
            *("tethered", 1278, 1e-4, 0.1278),
            *((0.0098, 0.0012, 0.0012), (0.0408, 0.0318, 0.0272), 0.0),
        ),
        (*("untethered", 45, 3e-3, 0.135), (0.0, 0.0, 0.0), (0.051, 0.048, 0.042), np.pi),
    ],
)
def test_recorded_steps_close_and_begin_as_published(
    name, samples, timestep, duration, swing, stance, neutral
):
    data = np.load(ASSETS / "steps" / f"{name}.npz", allow_pickle=False)
    np.testing.assert_array_equal(data["angles"][..., 0], data["angles"][..., -1])
    assert data["angles"].shape == (6, 7, samples)
    assert data["timestep"].shape == ()
    assert float(data["timestep"]) == timestep
    assert samples * float(data["timestep"]) == pytest.approx(duration)
    # front, middle, hind; the same on both sides
    np.testing.assert_allclose(data["swing_start_s"], swing * 2, atol=1e-12)
    np.testing.assert_allclose(data["stance_start_s"], stance * 2, atol=1e-12)
    assert float(data["neutral_phase"]) == neutral


def test_pose_names_all_joints_in_order():
    pose = json.loads((ASSETS / "poses" / "stretch.json").read_text(encoding="utf-8"))
    assert tuple(pose["angles"]) == JOINTS


@pytest.mark.parametrize(("shape", "worst_rms"), [("capsule", 0.016), ("hull", 0.011)])
def test_every_right_leg_segment_has_collision_shapes_that_fit(shape, worst_rms):
    rows = json.loads((ASSETS / "collision" / "legs.json").read_text(encoding="utf-8"))["segments"]
    assert {row["segment"] for row in rows} == {
        f"{leg}{segment}" for leg in LEGS if leg.startswith("R") for segment in LEG_SEGMENTS
    }
    tarsi = [row for row in rows if "Tarsus" in row["segment"]]
    assert max(row[shape]["fit_rms"] for row in tarsi) <= 0.005
    assert max(row[shape]["fit_rms"] for row in rows) <= worst_rms


@pytest.mark.slow
@pytest.mark.network
def test_the_wheels_give_the_same_bytes_again():
    pytest.importorskip("fast_simplification")
    script = ASSETS.parent / "tools" / "import_assets.py"
    result = subprocess.run(
        [sys.executable, str(script), "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
