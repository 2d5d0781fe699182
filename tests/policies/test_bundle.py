"""Policy files: what is written comes back, and nothing else is read."""

import dataclasses
import hashlib
import json
import pickle
import warnings

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save, save_file

from flyrl.policies import PolicyFileError, load_policy
from flyrl.policies.bundle import load_bundle, save_bundle
from tests.simulation.test_physics import BALANCED_1, BALANCED_2


@pytest.fixture
def path(tmp_path):
    return tmp_path / "policy.safetensors"


@pytest.fixture
def file(bundle, path):
    save_bundle(bundle, path)
    return path


@pytest.mark.parametrize("kind", ["bundle", "choosing", "recurrent"])
def test_everything_comes_back(kind, path, request):
    bundle = request.getfixturevalue(kind)
    save_bundle(bundle, path)
    np.testing.assert_equal(*map(dataclasses.asdict, (load_bundle(path), bundle)))


def test_same_policy_same_bytes(bundle, file, tmp_path):
    save_bundle(bundle, tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == file.read_bytes()


def test_run_folder_gives_best_else_last(bundle, tmp_path):
    with pytest.raises(PolicyFileError, match=r"a run folder holds best\.safetensors"):
        load_policy(tmp_path)
    save_bundle(bundle, tmp_path / "last.safetensors")
    assert load_bundle(tmp_path).training == {"decisions": 7}
    (tmp_path / "best.safetensors").write_bytes(b"x" * 100)
    with pytest.raises(PolicyFileError, match=r"best\.safetensors"):
        load_bundle(tmp_path)
    with pytest.raises(PolicyFileError, match=r"nowhere: there is no such file or folder"):
        load_policy(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("physics", "terrain", "version"),
    # the second version differs in boxes alone
    [(BALANCED_1, "flat", 1), (BALANCED_2, "flat", None), (BALANCED_2, "blocks", 2)],
)
def test_a_policy_of_an_earlier_preset_warns_once(bundle, path, physics, terrain, version):
    env = {"physics": dataclasses.asdict(physics), "terrain": {"name": terrain}}
    save_bundle(dataclasses.replace(bundle, env=env), path)
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("default")
        for _ in range(2):
            load_bundle(path)
    told = [f"trained with version {version} of the physics preset 'balanced'"] if version else []
    assert len(given) == len(told)
    assert all(words in str(warning.message) for words, warning in zip(told, given, strict=True))


def test_every_truncation_and_every_changed_byte_is_refused(file):
    data = bytearray(file.read_bytes())
    broken = [data[:length] for length in range(len(data))]
    broken += [data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :] for i in range(len(data))]
    for contents in (*broken, data + b"\0"):
        file.write_bytes(contents)
        with pytest.raises(PolicyFileError):
            load_policy(file)
    file.write_bytes(broken[-1])  # another weight
    with pytest.raises(PolicyFileError, match="changed after it was written"):
        load_policy(file)


def test_pickle_is_refused_unopened(path):
    class Trap:
        def __reduce__(self):
            return (path.with_name("sprung").touch, ())

    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(PolicyFileError, match="no safetensors file"):
        load_policy(path)
    assert not path.with_name("sprung").exists()


@pytest.mark.parametrize(
    ("tensors", "record", "message"),
    [
        (["weight"], None, "no flyrl policy"),
        ([f"{i}.weight" for i in range(20_000)], None, "is no policy: a header of"),
        (
            ["weight"],
            {"schema": "flyrl.policy/99", "sha256": "0" * 64},
            r"'flyrl\.policy/99'.*reads 'flyrl\.policy/1'",
        ),
    ],
)
def test_other_safetensors_files_are_refused_shortly(path, tensors, record, message):
    metadata = record and {"flyrl": json.dumps(record)}
    save_file({name: np.zeros(1, np.float32) for name in tensors}, path, metadata)
    with pytest.raises(PolicyFileError, match=message) as refused:
        load_policy(path)
    assert len(str(refused.value)) < 500


STATISTICS = {"mean": [0, 0, 0], "variance": [1, 1, 1], "epsilon": 1, "clip": 1}
OF_RECURRENT = (
    ({"normaliser": {"mean": [0.0]}}, "incomplete or wrong record"),
    ({"normaliser": STATISTICS | {"variance": [1, 1, "x"]}}, "variance must be numbers"),
    ({"normaliser": STATISTICS | {"variance": [1, 1, -1]}}, r"variance must be at least 0"),
    ({"normaliser": STATISTICS | {"epsilon": 0}}, r"epsilon must be a finite number above 0"),
    ({"normaliser": STATISTICS | {"clip": -1}}, r"clip must be a finite number above 0"),
    ({"normaliser": STATISTICS | {"mean": [0], "variance": [1]}}, "mean: 1 values, but 3 are"),
    ({"architecture": {"lstm_sizes": [3, 3]}}, r"'lstm\.1.*shape \(12,.*: None$"),
    ({"architecture": {"sizes": [3, 2, 2, 2]}}, r"'2\.weight': shape None; .*: \(2, 2\)"),
    ({"architecture": {"lstm_sizes": [3, 3, 4]}}, r"'lstm\.1.*\(12, 3\); .*: \(16, 3\)"),
    ({"architecture": {"lstm_sizes": [3]}}, r"at least one layer, got .* \(3,\)"),
    ({"architecture": {"sizes": []}}, r"at least one layer, got sizes \(\)"),
    ({"architecture": {"lstm_sizes": 7}}, "incomplete or wrong record"),
    ({"architecture": {"kind": "gru"}}, "architecture must be one of 'mlp', 'lstm'"),
    ({"training": {"algo": "\ud800"}}, r"policy\.safetensors .*record\.training\.algo must be"),
    ({"training": {"algo": "\x1b[2J"}}, r"record\.training\.algo must be printable"),
    ({"training": {"algo": "a" * 10_001}}, r"training\.algo must be printable text, at most"),
    ({"training": {"\x07": 1}}, r"a key of the record\.training must be printable"),
    ({"training": {"seed": [1, float("inf")]}}, r"training\.seed\[1\] must be a finite number"),
    ({"env": {"seed": 10**400}}, r"env\.seed must be a finite number"),
    ({"training": [["algo", "ppo"]]}, "training must be a Mapping"),
    ({"action": {"low": [float("nan"), -1], "high": [1, 1]}}, r"low\[0\] must be a finite number"),
    ({"action": {"low": [-1, 2], "high": [1, 1]}}, "bounds: 2.0 and 1.0; allowed: low"),
    ({"observation": [{"name": "all", "size": 5}]}, "terms: 5 values, but 3 are taken"),
    ({"observation": [{"name": "all", "size": 3.0}]}, "size must be a whole .*, got 3.0"),
    ({"observation": [{"name": 7, "size": 3}]}, "name must be text, got 7"),
)
OF_CHOOSING = (
    ({"action": {"low": [0, 0], "high": [2, 2]}}, "outputs: 5 values, but 6 are taken"),
    ({"action": {"low": [0], "high": [2, 1]}}, "upper action bounds: 2 values, but 1 are"),
    ({"action": {"low": [0, -0.5], "high": [2, 0.5]}}, "-0.5; allowed with .*: whole numbers"),
    ({"action": {"low": [0, 2e9], "high": [2, 3e9]}}, "bounds: 3000000000.0; allowed with"),
    ({"architecture": {"squashing": "clip"}}, "outputs: 5 values, but 2 are taken"),
    ({"architecture": {"squashing": "fold"}}, "one of 'clip', 'tanh', 'argmax', got 'fold'"),
)


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        *[("recurrent", *case) for case in OF_RECURRENT],
        *[("choosing", *case) for case in OF_CHOOSING],
    ],
)
def test_a_record_that_does_not_fit(kind, changes, message, path, request):
    save_bundle(request.getfixturevalue(kind), path)
    with safe_open(path, "np") as opened:
        record = json.loads(opened.metadata()["flyrl"])
    for key, value in changes.items():
        merged = {**record[key], **value} if key == "architecture" else value
        record = {**record, key: merged, "sha256": "0" * 64}
    data = save(load_file(path), {"flyrl": json.dumps(record)})
    digest = hashlib.sha256(data).hexdigest()
    path.write_bytes(data.replace(b"0" * 64, digest.encode(), 1))
    with pytest.raises(PolicyFileError, match=message):
        load_bundle(path)


def test_weights_that_are_not_finite_are_refused(bundle, path):
    bundle.weights["0.bias"][1] = np.nan
    save_bundle(bundle, path)
    with pytest.raises(PolicyFileError, match=r"tensor '0\.bias' is not of finite float32 values"):
        load_bundle(path)
