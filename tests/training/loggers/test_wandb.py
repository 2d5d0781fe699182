import json
import struct
import time
from dataclasses import replace

import pytest

from flyrl.training.config import training_record
from flyrl.training.learn import train
from flyrl.training.loggers import WandbConfig
from tests.training.loggers.tiny import TINY, UPDATES, crash_and_resume, logged

LOGGER = WandbConfig(project="flies", group="tiny")
_HEADER, _BLOCK = 7, 2**15


@pytest.fixture(autouse=True)
def _offline(monkeypatch):
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_ERROR_REPORTING", "false")
    monkeypatch.setenv("WANDB_SILENT", "true")


def _records(path):
    """Records of an offline run, whose file is a log in the format of LevelDB's."""
    from wandb.proto.wandb_internal_pb2 import Record

    data, position, parts = path.read_bytes(), _HEADER, b""
    while position + _HEADER <= len(data):
        if _BLOCK - position % _BLOCK < _HEADER:  # the rest of a block is too short for a record
            position += _BLOCK - position % _BLOCK
            continue
        _, size, kind = struct.unpack_from("<IHB", data, position)
        position += _HEADER
        if position + size > len(data):  # W&B's own process is still writing it
            return
        parts += data[position : position + size]
        position += size
        if kind in (1, 4):  # whole, or the last part
            record = Record()
            record.ParseFromString(parts)
            parts = b""
            yield record


def _records_to_the_end(path):
    """The records, once W&B's own process has written the last one."""
    deadline = time.monotonic() + 30
    while True:
        records = list(_records(path))
        if any(record.HasField("exit") for record in records):
            return records
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _key(item):
    return item.key or "/".join(item.nested_key)


def _offline_runs(folder):
    """Of every time that the run was opened: its description, and (step, key) -> value."""
    runs = []
    for path in sorted(folder.glob("wandb/offline-run-*/*.wandb")):
        description, values = None, {}
        for record in _records_to_the_end(path):
            if record.HasField("run"):
                description = record.run
            if record.HasField("history"):
                row = {_key(item): json.loads(item.value_json) for item in record.history.item}
                step = row["_step"]
                values |= {(step, key): value for key, value in row.items() if key[0] != "_"}
        runs.append((description, values))
    return runs


def test_a_run_is_logged_and_stays_the_same(tmp_path):
    config = replace(TINY, logger=LOGGER)
    run = train(config, tmp_path / "runs")
    ((description, values),) = _offline_runs(run.folder)
    # of the two rows at the last step, W&B makes one
    expected = {(step, key): value for step, key, value in logged(run.folder)}
    assert values == pytest.approx(expected, 1e-6)
    assert {step for step, _ in values} == set(UPDATES)
    assert (description.project, description.run_group) == ("flies", "tiny")
    assert description.display_name == run.folder.name
    settings = {item.key: json.loads(item.value_json) for item in description.config.update}
    expected = json.loads(json.dumps(training_record(config)))
    assert {key: settings[key] for key in expected} == expected

    alone = train(TINY, tmp_path / "alone")
    for name in ("last.safetensors", "evaluations.csv"):
        assert (alone.folder / name).read_bytes() == (run.folder / name).read_bytes()


def test_a_resumed_run_goes_on_and_no_update_is_logged_twice(tmp_path, monkeypatch):
    run = crash_and_resume(LOGGER, tmp_path / "runs", monkeypatch)
    folder = next(run)
    assert sorted({step for step, _ in _offline_runs(folder)[0][1]}) == UPDATES[:3]
    next(run)
    (first, before), (second, after) = _offline_runs(folder)
    record = json.loads((folder / "logger.json").read_text())
    assert record == {"logger": "wandb", "run_id": first.run_id, "url": None}
    assert first.run_id == second.run_id
    assert not before.keys() & after.keys()
    assert before.keys() | after.keys() == {point[:2] for point in logged(folder)}
