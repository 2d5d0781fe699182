from flyrl.evaluation.episodes import Parts, episode_row, episode_table, trajectory
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
    # nor does a damaged one
    (file,) = tmp_path.glob("*/*")
    for damage in (b"", b"PK\x03\x04 and no more"):
        file.write_bytes(damage)
        assert parts.read(1, 64) is None
