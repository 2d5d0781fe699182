import dataclasses
import hashlib
import json
import pickle
import warnings
import zipfile

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save, save_file

from flyrl.policies import PolicyFileError, load_policy
from flyrl.policies.bundle import load_bundle, save_bundle, trained_with_preset
from flyrl.simulation.physics import PRESET_VERSIONS, PresetVersion
from tests.policies.conftest import same_weights
from tests.simulation.test_physics import BALANCED_1


@pytest.fixture
def file(bundle, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_bundle(bundle, path)
    return path


def test_everything_comes_back(bundle, file):
    loaded = load_bundle(file)
    assert same_weights(loaded, bundle)
    assert loaded.network.activation == "relu"
    assert loaded.squashing == "clip"
    assert loaded.observation == bundle.observation
    assert (loaded.action_low, loaded.action_high) == ((-1, -1), (1, 1))
    assert loaded.env == {"task": "target"}
    assert loaded.training == {"decisions": 7}


def test_normaliser_and_lstm_come_back(recurrent, tmp_path):
    save_bundle(recurrent, tmp_path / "policy.safetensors")
    loaded = load_bundle(tmp_path / "policy.safetensors")
    for name in ("mean", "variance"):
        given = getattr(recurrent.normaliser, name)
        np.testing.assert_array_equal(getattr(loaded.normaliser, name), given)
    assert (loaded.normaliser.epsilon, loaded.normaliser.clip) == (1e-8, 10.0)
    assert loaded.lstm.sizes == (3, 3, 3)
    assert same_weights(loaded, recurrent)


def test_whole_numbers_come_back(choosing, tmp_path):
    save_bundle(choosing, tmp_path / "policy.safetensors")
    loaded = load_bundle(tmp_path / "policy.safetensors")
    assert loaded.squashing == "argmax"
    assert (loaded.action_low, loaded.action_high) == ((0, -1), (2, 0))
    assert loaded.action_counts == (3, 2)


def test_a_plain_bundle_has_neither(file):
    loaded = load_bundle(file)
    assert loaded.normaliser is None
    assert loaded.lstm is None


def test_same_policy_same_bytes(bundle, file, tmp_path):
    save_bundle(bundle, tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == file.read_bytes()


def test_saving_leaves_only_the_file(file):
    assert [path.name for path in file.parent.iterdir()] == ["policy.safetensors"]


def test_run_folder_gives_best_else_last(bundle, tmp_path):
    save_bundle(bundle, tmp_path / "last.safetensors")
    assert load_bundle(tmp_path).training == {"decisions": 7}
    (tmp_path / "best.safetensors").write_bytes(b"x" * 100)
    with pytest.raises(PolicyFileError, match=r"best\.safetensors"):
        load_bundle(tmp_path)


def test_a_policy_of_an_earlier_preset_is_told_of_once(bundle, tmp_path):
    path = tmp_path / "policy.safetensors"
    save_bundle(dataclasses.replace(bundle, env={"physics": BALANCED_1}), path)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for _ in range(2):
            load_bundle(path)
    (warning,) = told
    assert "was trained with version 1 of the physics preset 'balanced'" in str(warning.message)


@pytest.mark.parametrize(
    ("noted", "preset"),
    [
        ({"name": "fast", "version": 1}, PresetVersion("fast", 1)),
        ({"name": "fast", "version": "1"}, PresetVersion("balanced", 1)),
        ({"name": ["fast"], "version": 1}, PresetVersion("balanced", 1)),
        ("fast", PresetVersion("balanced", 1)),
        (None, PresetVersion("balanced", 1)),
    ],
)
def test_what_a_policy_notes_of_its_preset_comes_before_its_settings(bundle, noted, preset):
    env, training = {"physics": BALANCED_1}, {"physics_preset": noted}
    bundle = dataclasses.replace(bundle, env=env, training=training)
    assert trained_with_preset(bundle) == preset


def test_nothing_is_told_of_a_policy_of_a_preset_as_it_is(bundle, tmp_path):
    path = tmp_path / "policy.safetensors"
    noted = {"name": "balanced", "version": PRESET_VERSIONS["balanced"]}
    save_bundle(dataclasses.replace(bundle, training={"physics_preset": noted}), path)
    load_bundle(path)  # a warning would be an error


def test_missing_path(tmp_path):
    with pytest.raises(PolicyFileError, match=r"nowhere: there is no such file or folder"):
        load_policy(tmp_path / "nowhere")


def test_folder_without_policy(tmp_path):
    with pytest.raises(PolicyFileError, match=r"a run folder holds best\.safetensors"):
        load_policy(tmp_path)


def test_every_truncation(file):
    data = file.read_bytes()
    for length in range(len(data)):
        file.write_bytes(data[:length])
        with pytest.raises(PolicyFileError):
            load_policy(file)


def test_bytes_appended(file):
    file.write_bytes(file.read_bytes() + b"\0")
    with pytest.raises(PolicyFileError):
        load_policy(file)


def test_every_changed_byte(file):
    data = bytearray(file.read_bytes())
    for i in range(len(data)):
        data[i] ^= 1
        file.write_bytes(data)
        with pytest.raises(PolicyFileError):
            load_policy(file)
        data[i] ^= 1


def test_changed_weight_is_named_as_changed(file):
    data = bytearray(file.read_bytes())
    data[-1] ^= 0x40
    file.write_bytes(data)
    with pytest.raises(PolicyFileError, match="changed after it was written"):
        load_policy(file)


def test_random_bytes(tmp_path):
    path = tmp_path / "policy.safetensors"
    path.write_bytes(np.random.default_rng(0).bytes(10_000))
    with pytest.raises(PolicyFileError, match="no safetensors file"):
        load_policy(path)


def test_pickle_is_refused_unopened(tmp_path):
    path = tmp_path / "policy.safetensors"

    class Trap:
        def __reduce__(self):
            return (path.with_name("sprung").touch, ())

    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(PolicyFileError):
        load_policy(path)
    assert not path.with_name("sprung").exists()


def test_zip_is_refused(tmp_path):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(PolicyFileError):
        load_policy(path)


def test_foreign_safetensors_file(tmp_path):
    path = tmp_path / "other.safetensors"
    save_file({"weight": np.zeros(3, np.float32)}, path)
    with pytest.raises(PolicyFileError, match="no flyrl policy"):
        load_policy(path)


def test_many_tensors_are_refused_shortly(tmp_path):
    path = tmp_path / "many.safetensors"
    save_file({f"{i}.weight": np.zeros(1, np.float32) for i in range(20_000)}, path)
    with pytest.raises(PolicyFileError, match="is no policy: a header of") as refused:
        load_policy(path)
    assert len(str(refused.value)) < 500


def test_other_schema(file):
    record = {"schema": "flyrl.policy/99", "sha256": "0" * 64}
    save_file(load_file(file), file, {"flyrl": json.dumps(record)})
    with pytest.raises(PolicyFileError, match=r"'flyrl\.policy/99'.*reads 'flyrl\.policy/1'"):
        load_policy(file)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"normaliser": {"mean": [0.0]}}, "incomplete or wrong record"),
        (
            {"normaliser": {"mean": [0, 0, 0], "variance": [1, 1, "x"], "epsilon": 1, "clip": 1}},
            r"normaliser\.variance must be numbers",
        ),
        (
            {"normaliser": {"mean": [0], "variance": [1], "epsilon": 1, "clip": 1}},
            r"normaliser\.mean has 1 values, the observation 3",
        ),
        ({"architecture": {"lstm_sizes": [3, 3]}}, "tensors; allowed: .*; look at 'lstm"),
        ({"training": {"algo": "\ud800"}}, r"policy\.safetensors .*record\.training\.algo must be"),
        ({"training": {"algo": "\x1b[2J"}}, r"record\.training\.algo must be printable"),
        (
            {"training": {"algo": "a" * 10_001}},
            r"record\.training\.algo must be printable text, at most",
        ),
        ({"training": {"\x07": 1}}, r"a key of the record\.training must be printable"),
        ({"training": {"seed": [1, float("inf")]}}, r"training\.seed\[1\] must be a finite number"),
        ({"env": {"task": {"reach": float("nan")}}}, r"env\.task\.reach must be a finite number"),
        ({"env": {"seed": 10**400}}, r"env\.seed must be a finite number"),
        ({"training": [["algo", "ppo"]]}, "training must be an object"),
        ({"architecture": {"lstm_sizes": [3, 3, 4]}}, r"lstm_sizes \[3, 3, 4\], but"),
        ({"architecture": {"lstm_sizes": 7}}, "incomplete or wrong record"),
        ({"architecture": {"kind": "gru"}}, "architecture: 'gru'; allowed: mlp, lstm"),
        (
            {"action": {"low": [float("nan"), -1], "high": [1, 1]}},
            r"action\.low\[0\] must be a finite number",
        ),
        ({"action": {"low": [-1, 2], "high": [1, 1]}}, "bounds: 2.0 and 1.0; allowed: finite"),
        ({"observation": [{"name": "all", "size": 3.0}]}, "size of 'all': 3.0; allowed: 1, 2"),
        ({"observation": [{"name": "all", "size": -1}]}, "size of 'all': -1; allowed: 1, 2"),
        ({"observation": [{"name": 7, "size": 3}]}, "name of an observation term: 7; allowed"),
    ],
)
def test_a_record_that_does_not_fit(recurrent, tmp_path, changes, message):
    _check_refused(recurrent, tmp_path / "policy.safetensors", changes, message)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"action": {"low": [0, 0], "high": [2, 2]}},
            "that 6 whole numbers lie within, .* gives 5",
        ),
        ({"action": {"low": [0], "high": [3]}}, "that 4 whole numbers lie within, .* gives 5"),
        ({"action": {"low": [0], "high": [2, 1]}}, "of 1 and 2 values, the network gives 5"),
        ({"action": {"low": [0, -0.5], "high": [2, 0.5]}}, "-0.5; allowed with .*: whole numbers"),
        ({"action": {"low": [0, 2e9], "high": [2, 3e9]}}, "bounds: 3000000000.0; allowed with"),
        (
            {"action": {"low": [0, 0], "high": [2, float("inf")]}},
            r"action\.high\[1\] must be a finite number",
        ),
        ({"architecture": {"squashing": "clip"}}, "of 2 and 2 values, the network gives 5"),
    ],
)
def test_a_record_that_does_not_fit_whole_numbers(choosing, tmp_path, changes, message):
    _check_refused(choosing, tmp_path / "policy.safetensors", changes, message)


def _check_refused(bundle, file, changes, message):
    save_bundle(bundle, file)
    with safe_open(file, "np") as opened:
        record = json.loads(opened.metadata()["flyrl"])
    for key, value in changes.items():
        merged = {**record[key], **value} if key == "architecture" else value
        record = {**record, key: merged, "sha256": "0" * 64}
    data = save(load_file(file), {"flyrl": json.dumps(record)})
    digest = hashlib.sha256(data).hexdigest()
    file.write_bytes(data.replace(b"0" * 64, digest.encode(), 1))
    with pytest.raises(PolicyFileError, match=message):
        load_bundle(file)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observation": (("bearing", 5),)}, "5 values, the network takes 3"),
        ({"action_low": (-1.0,)}, "the network gives 2"),
        ({"squashing": "fold"}, "squashing: 'fold'; allowed: clip, tanh, argmax"),
        ({"squashing": "argmax"}, "bounds that 6 whole numbers lie within, the network gives 2"),
    ],
)
def test_bundle_checks_itself(bundle, changes, message):
    from dataclasses import replace

    from flyrl.policies import TermLayout

    if "observation" in changes:
        changes = {"observation": tuple(TermLayout(*term) for term in changes["observation"])}
    with pytest.raises(ValueError, match=message):
        replace(bundle, **changes)
