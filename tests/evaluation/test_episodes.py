import pytest

from flyrl.evaluation.episodes import Parts, drop_parts, episode_row, episode_table, trajectory
from flyrl.files import MANIFEST
from tests.synthetic import make_record

RECORDS = [make_record([(0, 0), (i, 1 / 3)], index=i) for i in range(3)]
PART = (
    episode_table([episode_row(record) for record in RECORDS]),
    dict(enumerate(map(trajectory, RECORDS[:2]))),
)


def test_a_batch_of_another_place_or_other_settings_does_not_count(tmp_path):
    parts = Parts(tmp_path, {"seed": 0})
    parts.write(1, 64, PART)
    assert parts.read(1, 128) is None
    assert Parts(tmp_path, {"seed": 1}).read(1, 64) is None


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 and no more"])
def test_a_damaged_batch_does_not_count(tmp_path, damage):
    parts = Parts(tmp_path, {})
    parts.write(0, 0, PART)
    (file,) = tmp_path.glob("*/*")
    file.write_bytes(damage)
    assert parts.read(0, 0) is None


def test_dropping_leaves_the_rest_of_the_folder(tmp_path):
    Parts(tmp_path, {}).write(0, 0, PART)
    (tmp_path / "results.json").write_text("{}")
    drop_parts(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {MANIFEST, "results.json"}
