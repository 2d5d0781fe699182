"""Files of walks, read back by those who know them."""

import sys

import numpy as np
import pandas as pd
import pytest

import flyrl
from flyrl.anatomy import JOINTS, LEGS


@pytest.fixture(scope="module")
def walk():
    return flyrl.walk("cpg", drive=(1, 0.8), seconds=0.1, every=2e-3)


def test_numpy_arrays_can_be_replayed(walk, tmp_path):
    path = walk.save(tmp_path / "walk.npz")
    with np.load(path) as arrays:
        np.testing.assert_array_equal(arrays["joints"], walk.frame()[list(JOINTS)])
        np.testing.assert_array_equal(arrays["adhesion"], walk.frame()[_of_legs("adhesion")])
        np.testing.assert_array_equal(arrays["fz_LM"], walk.frame().fz_LM)
        again = flyrl.walk(joints=arrays["joints"], adhesion=arrays["adhesion"], rate_hz=500)
    assert len(again.frame()) > 0.9 * len(walk.frame())


def test_csv_and_parquet(walk, tmp_path):
    table = pd.read_csv(walk.save(tmp_path / "walk.csv"))
    pd.testing.assert_frame_equal(table, walk.frame(), rtol=1e-5, check_dtype=False)
    pytest.importorskip("pyarrow")
    table = pd.read_parquet(walk.save(tmp_path / "walk.parquet"))
    pd.testing.assert_frame_equal(table, walk.frame())


def test_nwb_is_valid_and_holds_time_series_in_si_units(walk, tmp_path):
    pynwb = pytest.importorskip("pynwb")
    path, table = walk.save(tmp_path / "walk.nwb"), walk.frame()
    assert not pynwb.validate(path=str(path))
    with pynwb.NWBHDF5IO(str(path), "r") as file:
        nwb = file.read()
        assert nwb.subject.species == "Drosophila melanogaster"
        found = nwb.processing["behavior"].data_interfaces
        joints, forces = found["joint_angles"], found["contact_forces"]
        np.testing.assert_array_equal(joints.data[:], table[list(JOINTS)])
        assert (joints.unit, joints.starting_time, joints.rate) == ("rad", 0.0, pytest.approx(500))
        assert joints.description.split(", ") == list(JOINTS)
        np.testing.assert_array_equal(forces.data[:, 2], table.fz_LF)
        assert (forces.unit, forces.conversion) == ("N", 1e-6)
        np.testing.assert_array_equal(found["stance"].data[:], table[_of_legs("stance")])
        np.testing.assert_array_equal(found["command"].data[-1], [1, 0.8])


@pytest.mark.parametrize(("suffix", "package"), [("parquet", "pyarrow"), ("nwb", "pynwb")])
def test_a_missing_package_is_named_with_the_command_that_installs_it(
    walk, tmp_path, monkeypatch, suffix, package
):
    monkeypatch.setitem(sys.modules, package, None)
    message = rf"walk.{suffix} needs {package}, which is not .*: pip install -e '.\[{suffix}\]'"
    with pytest.raises(ValueError, match=message):
        walk.save(tmp_path / f"walk.{suffix}")
    assert not list(tmp_path.iterdir())


def test_another_suffix_is_refused(walk, tmp_path):
    with pytest.raises(ValueError, match=r"suffix of 'walk\.cvs' must be .* did you mean '\.csv'"):
        walk.save(tmp_path / "walk.cvs")


def _of_legs(name):
    return [f"{name}_{leg}" for leg in LEGS]
