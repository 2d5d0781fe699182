import re
from dataclasses import replace

import numpy as np
import pytest

from flyrl.cli.main import main
from flyrl.policies.bundle import TermLayout, weight_shapes
from flyrl.policies.networks import Normaliser
from flyrl.training.learn import train
from flyrl.training.loggers import MlflowConfig
from flyrl.training.provenance import compare, difference
from flyrl.training.runs import read_run
from tests.bundles import target_bundle
from tests.tiny import TINY
from tests.training.folders import COMMIT, make_run


def test_a_run_is_repeated_to_the_bit_and_the_repeat_told_to_no_service(
    tmp_path, monkeypatch, capsys
):
    import mlflow

    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    monkeypatch.setenv("MLFLOW_DISABLE_TELEMETRY", "true")
    logger = MlflowConfig(tracking_uri=(tmp_path / "store").as_uri())
    original = train(replace(TINY, logger=logger), tmp_path)
    status = main(["reproduce", str(original.folder), "--runs-folder", str(tmp_path / "again")])
    output = capsys.readouterr().out.splitlines()
    assert status == 0
    assert output[:2] == ["policy: identical, bit for bit", "evaluations: identical"]
    repeat = output[-1].removeprefix("repeat: ")
    assert main(["reproduce", str(original.folder), "--repeat", repeat]) == 0
    client = mlflow.MlflowClient(tracking_uri=logger.tracking_uri)
    assert len(client.search_runs([client.get_experiment_by_name("flyrl").experiment_id])) == 1


NORMALISER = Normaliser(np.zeros(47), np.ones(47), 1e-8, 10.0)
BUNDLE = target_bundle(normaliser=NORMALISER)
WITH_MEMORY = {
    "sizes": (3, 2),
    "lstm_sizes": (47, 3),
    "weights": {
        name: np.zeros(shape, np.float32) for name, shape in weight_shapes((3, 2), (47, 3)).items()
    },
}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"squashing": "tanh"}, "squashing clip, in the repeat tanh"),
        ({"normaliser": None}, r"normaliser \(1e-08, 10.0\), in the repeat None"),
        ({"action_high": (1.0, 2.0)}, r"action\.high"),
        ({"observation": (TermLayout("b", 47),)}, "observation"),
        (WITH_MEMORY, "kind mlp, in the repeat lstm"),
        # 47 * 2 + 2
        (
            {"weights": {**BUNDLE.weights, "0.bias": np.array([0.5, 0.0], np.float32)}},
            "^1 of 96 parameters differ, by at most 0.5$",
        ),
        (
            {"normaliser": replace(NORMALISER, mean=np.append(np.zeros(46), 2.0**-60))},
            "^1 of 94 statistics of the normaliser differ, by at most 8.67e-19$",
        ),
    ],
)
def test_another_policy_is_told(changes, told):
    assert difference(BUNDLE, replace(BUNDLE)) is None
    assert re.search(told, difference(BUNDLE, replace(BUNDLE, **changes)))


@pytest.fixture
def compared(tmp_path):
    """Compare two runs, given as `make_run` takes them."""

    def compared(first, second):
        folders = [make_run(tmp_path / "a", **first), make_run(tmp_path / "b", **second)]
        return compare(*map(read_run, folders))

    return compared


@pytest.mark.parametrize(("bias", "told"), [(0.25, "by at most 0.25"), (-0.0, "by at most 0")])
def test_other_bits_of_parameters_are_told_with_the_largest_difference(compared, bias, told):
    """Zeros of the other sign are other bits."""
    result = compared({"bias": 0.0}, {"bias": bias})
    assert "2 of " in result.policy
    assert result.policy.endswith(f"parameters differ, {told}")
    assert not result.is_identical


@pytest.mark.parametrize(
    ("evaluations", "told"),
    [
        ([(200, 0.5, 2.5)], "differ from decision 200 on: mean_return 2, in the repeat 2.5"),
        ([], "2, in the repeat 1"),
    ],
)
def test_the_first_difference_of_the_evaluations_is_told(compared, evaluations, told):
    begun = (100, 0.5, 1.0)
    first = {"evaluations": [begun, (200, 0.5, 2.0)]}
    assert compared(first, {"evaluations": [begun, *evaluations]}).evaluations == told


def test_evaluations_of_other_columns_differ(tmp_path):
    runs = [make_run(tmp_path / name, evaluations=[(100, 0.5, 1.0)]) for name in "ab"]
    (runs[0] / "evaluations.csv").write_text(
        "decisions,success_rate,mean_return,mean_duration_s,error\n100,0.5,1,1,2\n"
    )
    told = compare(*map(read_run, runs)).evaluations
    assert told == "differ from decision 100 on: error 2, in the repeat nan"


DIRTY = {"commit": COMMIT, "is_dirty": True, "diff": "x"}
PACKAGES = {"packages": {"numpy": "2.0"}}
RESUMED = [{"git": {"commit": COMMIT, "is_dirty": False}, "packages": {"numpy": "2.1"}}]


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        (
            {**PACKAGES, "cpu": {"flags": "sse avx"}},
            {"packages": {"numpy": "2.1"}, "cpu": {"flags": "sse fma"}},
            ("packages.numpy: 2.0, in the repeat 2.1", "CPU flags: without avx; with fma"),
        ),
        (
            {**PACKAGES, "resumed": RESUMED},
            PACKAGES,
            ("within the run: packages.numpy: 2.0, after an interruption 2.1",),
        ),
        ({"git": DIRTY}, {"git": DIRTY}, ()),
        (
            {"git": DIRTY},
            {"git": {**DIRTY, "diff": "y"}},
            ("the code has other changes beyond its commit: see code.diff",),
        ),
    ],
)
def test_where_they_come_from_is_told_but_is_no_difference_of_results(
    compared, first, second, told
):
    result = compared({"provenance": first}, {"provenance": second})
    assert result.is_identical
    assert result.origins == told


@pytest.mark.parametrize(
    ("original", "repeat", "status", "told"),
    [
        ({}, {"bias": 1.0}, 1, "by at most 1"),
        ({"interrupted_by": "SIGTERM"}, {}, 2, "no finished run to compare with: it is interrup"),
        ({}, {"seed": 1}, 2, "is no repeat: it has other settings"),
    ],
)
def test_a_difference_is_the_exit_status(tmp_path, capsys, original, repeat, status, told):
    runs = [make_run(tmp_path / "a", **original), make_run(tmp_path / "b", **repeat)]
    assert main(["reproduce", str(runs[0]), "--repeat", str(runs[1])]) == status
    assert told in "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: b"damaged", "last.safetensors is no safetensors file"),
        (lambda data: data[:-1] + bytes([data[-1] ^ 1]), "was changed after it was written"),
    ],
)
def test_a_damaged_policy_is_found_before_the_run_is_repeated(tmp_path, capsys, damage, message):
    file = make_run(tmp_path / "a") / "last.safetensors"
    file.write_bytes(damage(file.read_bytes()))
    assert main(["reproduce", str(file.parent), "--runs-folder", str(tmp_path / "again")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "again").exists()
