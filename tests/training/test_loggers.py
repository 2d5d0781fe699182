"""Real services: MLflow with a store in files, Weights & Biases offline."""

import json
import math
import struct
import time
from dataclasses import replace

import pytest

from flyrl.training.config import training_record
from flyrl.training.learn import resume, train
from flyrl.training.loggers import LoggerConfig, LoggerError, MlflowConfig, WandbConfig
from flyrl.training.metrics import RemoteLog
from flyrl.training.run_folder import create_folder
from flyrl.training.runs import flat, read_rows
from tests import tiny
from tests.training.folders import before

DECISIONS = "time/total_timesteps"
UPDATES = [32, 64, 96, 128]
TINY = replace(
    tiny.TINY,
    training=replace(
        tiny.TINY.training,
        total_timesteps=128,
        evaluation_interval=64,
        evaluation_episodes=1,
        checkpoint_interval=64,
    ),
)


def _logged(folder):
    """What progress.csv holds: (step, key, value), in order of step and key.

    The last row has the step of the one before; some keys are in both.
    """
    points, step = [], 0
    for row in read_rows(folder / "progress.csv"):
        step = int(row[DECISIONS] or step)
        points += [(step, key, float(text)) for key, text in row.items() if text]
    return sorted(points, key=lambda point: point[:2])


def _crash(logger, runs):
    """Train until a crash after 120 decisions, logged up to 96; the checkpoint is that at 64."""

    def crash(callback):
        if callback.num_timesteps == 120:
            raise RuntimeError("the crash")

    with before("_on_step", crash), pytest.raises(RuntimeError, match="the crash"):
        train(replace(TINY, logger=logger), runs)
    (folder,) = runs.iterdir()
    return folder


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """What the run comes to without a logger, by name of the file."""
    folder = train(TINY, tmp_path_factory.mktemp("alone")).folder
    return {name: (folder / name).read_bytes() for name in ("last.safetensors", "evaluations.csv")}


class _Nowhere(LoggerConfig):
    name = "no_such_service"

    def open(self, folder, settings, run_id):
        raise NotImplementedError


def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch):
    (tmp_path / "no_such_service").mkdir()  # which is no package
    monkeypatch.syspath_prepend(tmp_path)
    message = (
        "logger=no_such_service needs the package no_such_service: "
        r"pip install -e '\.\[no_such_service\]'"
    )
    with pytest.raises(ValueError, match=message):
        _Nowhere().check_installed()


# --- MLflow


@pytest.fixture
def mlflow(tmp_path, monkeypatch):
    """A store in files, which needs neither a server nor a database."""
    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    monkeypatch.setenv("MLFLOW_DISABLE_TELEMETRY", "true")
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    return MlflowConfig(tracking_uri=(tmp_path / "store").as_uri())


def _client(logger):
    import mlflow

    return mlflow.MlflowClient(tracking_uri=logger.tracking_uri)


def _remote(logger):
    """The only run of the store."""
    client = _client(logger)
    (run,) = client.search_runs([client.get_experiment_by_name("flyrl").experiment_id])
    return run


def _sent(logger):
    """What the store has, as `_logged`."""
    run = _remote(logger)
    points = [
        (metric.step, key, metric.value)
        for key in run.data.metrics
        for metric in _client(logger).get_metric_history(run.info.run_id, key)
    ]
    return sorted(points, key=lambda point: point[:2])


def test_mlflow_gets_every_update_of_a_resumed_run_once(mlflow, tmp_path, results):
    folder = _crash(mlflow, tmp_path / "runs")
    crashed = _remote(mlflow)
    assert crashed.info.status == "FAILED"
    assert json.loads((folder / "logger.json").read_text())["run_id"] == crashed.info.run_id
    assert [step for step, key, _ in _sent(mlflow) if key == DECISIONS] == UPDATES[:3]

    def at_end(run):
        (run.folder / "learning_curve.png").write_bytes(b"a curve")

    config = replace(TINY, logger=mlflow)
    resume(config, folder, at_end=at_end)
    remote = _remote(mlflow)
    sent, expected = _sent(mlflow), _logged(folder)
    assert [point[:2] for point in sent] == [point[:2] for point in expected]
    # the table has the digits of 32 bits; the times are those of before the crash
    values, others = (
        [value for _, key, value in points if not key.startswith("time/")]
        for points in (sent, expected)
    )
    assert values == pytest.approx(others, 1e-6)
    assert remote.info.run_name == folder.name
    assert remote.info.status == "FINISHED"
    settings = flat(training_record(config))
    assert remote.data.params == {key: str(value) for key, value in settings.items()}
    artifacts = {file.path for file in _client(mlflow).list_artifacts(remote.info.run_id)}
    assert artifacts == {"best.safetensors", "learning_curve.png"}
    assert {name: (folder / name).read_bytes() for name in results} == results


def test_an_outage_is_a_warning_and_what_is_lost_is_counted_at_the_end(mlflow, tmp_path, capsys):
    remote = RemoteLog(mlflow, create_folder(TINY, tmp_path / "runs"), {})
    remote.connect()
    remote.write({"a": 1.0}, {"a": ()}, step=1)
    (tmp_path / "store").rename(tmp_path / "away")
    remote.write({"a": 2.0}, {"a": ()}, step=2)
    (tmp_path / "away").rename(tmp_path / "store")
    remote.write({"a": 3.0}, {"a": ()}, step=3)  # not tried: less than a minute has passed
    remote._paused_until_s = 1.0
    remote.write({"a": 4.0, "b": math.nan, "text": "a"}, dict.fromkeys(["a", "b", "text"], ()), 4)
    remote.finish("finished")
    *sent, (step, key, value) = _sent(mlflow)
    assert sent == [(1, "a", 1.0), (4, "a", 4.0)]
    assert (step, key, math.isnan(value)) == (4, "b", True)
    assert _remote(mlflow).info.status == "FINISHED"
    first, last = capsys.readouterr().err.splitlines()
    assert first.startswith("warning: mlflow is out of reach, training goes on: ")
    assert last.startswith("warning: mlflow lacks 2 rows of metrics, which are in ")


def test_a_service_out_of_reach_at_the_start_is_an_error(mlflow, tmp_path):
    # nothing listens at port 9 (discard)
    config = replace(TINY, logger=MlflowConfig(tracking_uri="http://127.0.0.1:9"))
    with pytest.raises(LoggerError, match=r"logger=mlflow: .*127\.0\.0\.1"):
        train(config, tmp_path / "runs")


# --- Weights & Biases

WANDB = WandbConfig(project="flies", group="tiny")
_HEADER, _BLOCK = 7, 2**15


@pytest.fixture
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


@pytest.mark.usefixtures("_offline")
def test_wandb_gets_every_update_of_a_resumed_run_once(tmp_path, results):
    folder = _crash(WANDB, tmp_path / "runs")
    config = replace(TINY, logger=WANDB)
    resume(config, folder)
    (first, before), (second, after) = _offline_runs(folder)
    assert sorted({step for step, _ in before}) == UPDATES[:3]
    record = json.loads((folder / "logger.json").read_text())
    assert record == {"logger": "wandb", "run_id": first.run_id, "url": None}
    assert first.run_id == second.run_id
    assert not before.keys() & after.keys()
    # of the two rows at the last step, W&B makes one; the times are those of before the crash
    points = {(step, key): value for step, key, value in _logged(folder)}
    assert before.keys() | after.keys() == points.keys()
    sent = {point: value for point, value in {**before, **after}.items() if "time/" not in point[1]}
    assert sent == pytest.approx({point: points[point] for point in sent}, 1e-6)
    assert (first.project, first.run_group) == ("flies", "tiny")
    assert first.display_name == folder.name
    settings = {item.key: json.loads(item.value_json) for item in first.config.update}
    expected = json.loads(json.dumps(training_record(config)))
    assert {key: settings[key] for key in expected} == expected
    assert {name: (folder / name).read_bytes() for name in results} == results
