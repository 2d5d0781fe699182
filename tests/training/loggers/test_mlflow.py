import json
import math
from dataclasses import replace

import pytest

from flyrl.training.config import training_record
from flyrl.training.learn import train
from flyrl.training.loggers import LoggerError, MlflowConfig
from flyrl.training.loggers.remote import RemoteLog
from flyrl.training.run_folder import RunFolder
from flyrl.training.runs import flat
from tests.training.loggers.tiny import DECISIONS, TINY, UPDATES, crash_and_resume, logged


@pytest.fixture
def logger(tmp_path, monkeypatch):
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
    """What the store has, as `logged`."""
    run = _remote(logger)
    points = [
        (metric.step, key, metric.value)
        for key in run.data.metrics
        for metric in _client(logger).get_metric_history(run.info.run_id, key)
    ]
    return sorted(points, key=lambda point: point[:2])


def test_a_run_is_sent_and_stays_the_same(logger, tmp_path):
    def at_end(run):
        (run.folder / "learning_curve.png").write_bytes(b"a curve")

    run = train(replace(TINY, logger=logger), tmp_path / "runs", at_end=at_end)
    remote = _remote(logger)
    sent, expected = _sent(logger), logged(run.folder)
    assert [point[:2] for point in sent] == [point[:2] for point in expected]
    # the table has the digits of 32 bits
    assert [point[2] for point in sent] == pytest.approx([point[2] for point in expected], 1e-6)
    assert {step for step, _, _ in sent} == set(UPDATES)
    assert remote.info.run_name == run.folder.name
    assert remote.info.status == "FINISHED"
    settings = flat(training_record(replace(TINY, logger=logger)))
    assert remote.data.params == {key: str(value) for key, value in settings.items()}
    artifacts = {file.path for file in _client(logger).list_artifacts(remote.info.run_id)}
    assert artifacts == {"best.safetensors", "learning_curve.png"}

    alone = train(TINY, tmp_path / "alone")
    for name in ("last.safetensors", "evaluations.csv"):
        assert (alone.folder / name).read_bytes() == (run.folder / name).read_bytes()


def test_a_resumed_run_goes_on_and_no_update_is_sent_twice(logger, tmp_path, monkeypatch):
    run = crash_and_resume(logger, tmp_path / "runs", monkeypatch)
    folder = next(run)
    crashed = _remote(logger)
    assert crashed.info.status == "FAILED"
    assert json.loads((folder / "logger.json").read_text())["run_id"] == crashed.info.run_id
    assert [step for step, key, _ in _sent(logger) if key == DECISIONS] == UPDATES[:3]
    next(run)
    assert _remote(logger).info.status == "FINISHED"
    points = [point[:2] for point in _sent(logger)]
    assert points == [point[:2] for point in logged(folder)]


def test_an_outage_is_told_once_and_nothing_is_lost(logger, tmp_path, capsys):
    folder = RunFolder.create(TINY, tmp_path / "runs")
    remote = RemoteLog(logger, folder, {})
    remote.connect()
    remote.write({"a": 1.0}, {"a": ()}, step=1)
    (tmp_path / "store").rename(tmp_path / "away")
    remote.write({"a": 2.0}, {"a": ()}, step=2)
    remote._retry_at_s = 0.0
    remote.write({"a": 3.0}, {"a": ()}, step=3)
    (tmp_path / "away").rename(tmp_path / "store")
    remote.finish("finished")
    assert _sent(logger) == [(1, "a", 1.0), (2, "a", 2.0), (3, "a", 3.0)]
    assert _remote(logger).info.status == "FINISHED"
    assert capsys.readouterr().err.count("mlflow is out of reach, training goes on: ") == 1


def test_what_never_arrives_is_told_at_the_end(logger, tmp_path, capsys):
    folder = RunFolder.create(TINY, tmp_path / "runs")
    remote = RemoteLog(logger, folder, {})
    remote.connect()
    (tmp_path / "store").rename(tmp_path / "away")
    remote.write({"a": 2.0}, {"a": ()}, step=2)
    remote.finish("finished", [folder.path / "config.yaml"])
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == (f"warning: mlflow is out of reach: 1 rows of metrics are in {folder.path} only")


def test_while_a_service_is_out_of_reach_training_does_not_wait_for_it(logger, tmp_path, capsys):
    remote = RemoteLog(logger, RunFolder.create(TINY, tmp_path / "runs"), {})
    remote.connect()
    (tmp_path / "store").rename(tmp_path / "away")
    remote.write({"a": 1.0}, {"a": ()}, step=1)
    (tmp_path / "away").rename(tmp_path / "store")
    remote.write({"a": 2.0}, {"a": ()}, step=2)
    assert _sent(logger) == []  # not before a minute has passed
    assert "out of reach" in capsys.readouterr().err


def test_only_numbers_are_sent(logger, tmp_path):
    remote = RemoteLog(logger, RunFolder.create(TINY, tmp_path / "runs"), {})
    remote.write({"text": "a", "not a number": math.nan, "one": 1}, dict.fromkeys("abc", ()), 7)
    remote.finish("finished")
    (nan, one) = _sent(logger)
    assert (nan[:2], one) == ((7, "not a number"), (7, "one", 1.0))
    assert math.isnan(nan[2])


def test_a_service_out_of_reach_at_the_start_is_an_error(logger, tmp_path):
    # nothing listens at port 9 (discard)
    config = replace(TINY, logger=MlflowConfig(tracking_uri="http://127.0.0.1:9"))
    with pytest.raises(LoggerError, match=r"logger=mlflow: .*127\.0\.0\.1"):
        train(config, tmp_path / "runs")
