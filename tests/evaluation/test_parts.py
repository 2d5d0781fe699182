import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from flyrl.evaluation.rows import episode_row, episode_table, trajectory
from flyrl.evaluation.run import Parts, drop_parts
from flyrl.files import MANIFEST
from tests.synthetic import make_record

RECORDS = [make_record([(0, 0), (i, 1)], index=i) for i in range(3)]
PART = (
    episode_table([episode_row(record) for record in RECORDS]),
    [trajectory(record) for record in RECORDS[:2]],
)


def test_a_batch_comes_back_as_it_was(tmp_path):
    Parts(tmp_path, {"seed": 0}).write((1, 64), PART)
    rows, paths = Parts(tmp_path, {"seed": 0}).read((1, 64))
    assert_frame_equal(rows, PART[0])
    for path, before in zip(paths, PART[1], strict=True):
        np.testing.assert_array_equal(path.position_w, before.position_w)


def test_a_batch_that_was_not_walked_is_none(tmp_path):
    parts = Parts(tmp_path, {})
    parts.write((1, 64), PART)
    assert parts.read((1, 128)) is None


def test_a_batch_of_other_settings_does_not_count(tmp_path):
    Parts(tmp_path, {"seed": 0}).write((1, 64), PART)
    assert Parts(tmp_path, {"seed": 1}).read((1, 64)) is None


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 and no more"])
def test_a_damaged_batch_does_not_count(tmp_path, damage):
    parts = Parts(tmp_path, {})
    parts.write((0, 0), PART)
    (file,) = tmp_path.glob("*/*")
    file.write_bytes(damage)
    assert parts.read((0, 0)) is None


def test_without_a_folder_nothing_is_kept():
    parts = Parts(None, {})
    parts.write((0, 0), PART)
    assert parts.read((0, 0)) is None


def test_dropping_leaves_the_rest_of_the_folder(tmp_path):
    Parts(tmp_path, {}).write((0, 0), PART)
    (tmp_path / "results.json").write_text("{}")
    drop_parts(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {MANIFEST, "results.json"}
