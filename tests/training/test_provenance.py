import subprocess

import flyrl
from flyrl.training.provenance import code_changes, provenance


def _git(folder, *arguments):
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    subprocess.run(["git", "-C", folder, *identity, *arguments], check=True, capture_output=True)


def _checkout(folder, monkeypatch):
    package = folder / "flyrl" / "__init__.py"
    package.parent.mkdir()
    package.write_text("a = 1\n")
    _git(folder, "init")
    _git(folder, "add", ".")
    _git(folder, "commit", "-m", "first")
    monkeypatch.setattr(flyrl, "__file__", str(package))
    return package


def test_a_clean_checkout_has_a_commit_and_no_changes(tmp_path, monkeypatch):
    _checkout(tmp_path, monkeypatch)
    git = provenance()["git"]
    assert len(git["commit"]) == 40
    assert git["is_dirty"] is False
    assert code_changes() == ""


def test_changes_are_a_diff(tmp_path, monkeypatch):
    package = _checkout(tmp_path, monkeypatch)
    package.write_text("a = 2\n")
    assert provenance()["git"]["is_dirty"] is True
    assert code_changes().endswith("-a = 1\n+a = 2\n")


def test_an_installed_package_has_neither(tmp_path, monkeypatch):
    monkeypatch.setattr(flyrl, "__file__", str(tmp_path / "flyrl" / "__init__.py"))
    assert provenance()["git"] is None
    assert code_changes() == ""
