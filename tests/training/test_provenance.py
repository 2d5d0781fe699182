import hashlib

import pytest

from flyrl.training.provenance import code_changes, cpu, differences, provenance
from tests.training.folders import checkout, git


@pytest.mark.parametrize(
    "contents",
    [b"a = 2\n\n", b"a = '\xe9'\n\n", b"\0\xff\n\n"],
    ids=["blank_last_line", "latin_1", "binary"],
)
def test_changes_can_be_applied(tmp_path, monkeypatch, contents):
    package = checkout(tmp_path, b"a = 1\n\n")
    monkeypatch.setattr("flyrl.training.provenance._PACKAGE", package.parent)
    record = provenance()["git"]
    assert len(record.pop("commit")) == 40
    assert record == {"is_dirty": False, "diff": None, "untracked": {}}
    assert code_changes() == b""
    git(tmp_path, "config", "diff.external", "true")
    git(tmp_path, "config", "color.diff", "always")
    package.write_bytes(contents)
    changes, record = code_changes(), provenance()["git"]
    assert record["is_dirty"] is True
    assert record["diff"] == hashlib.sha256(changes).hexdigest()
    (tmp_path / "code.diff").write_bytes(changes)
    git(tmp_path, "checkout", ".")
    git(tmp_path, "apply", "code.diff")
    assert package.read_bytes() == contents


def test_files_that_git_does_not_know_are_named(tmp_path, monkeypatch):
    package = checkout(tmp_path)
    monkeypatch.setattr("flyrl.training.provenance._PACKAGE", package.parent)
    (package.parent / "new.py").write_bytes(b"")
    (tmp_path / "notes").write_text("")
    # of no bytes, as FIPS 180 has it
    digest = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert provenance()["git"]["untracked"] == {"flyrl/new.py": digest}


def test_what_differs_is_a_line_each_without_control_characters():
    told = differences({"packages": {"torch": "2\x1b[2J\n3"}}, {"packages": {"torch": "2"}}, "now")
    assert told == ["packages.torch: 2?[2J 3, now 2"]


@pytest.mark.parametrize("key", ["flags", "Features"], ids=["x86", "arm"])
def test_instruction_sets_of_the_first_cpu(key):
    info = f"model name\t: A\n{key}\t\t: fp asimd\n\nmodel name\t: B\n{key}\t\t: fp\n"
    assert cpu(info) == {"model": "A", "flags": "fp asimd"}


def test_an_installed_package_has_neither(tmp_path, monkeypatch):
    monkeypatch.setattr("flyrl.training.provenance._PACKAGE", tmp_path / "flyrl")
    assert provenance()["git"] is None
    assert code_changes() == b""
