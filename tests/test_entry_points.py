import sys

import pytest

from flyrl.entry_points import is_entry_point, load_module


@pytest.mark.parametrize("name", ["mine:make", "my.own_module:MAKE"])
def test_module_and_attribute(name):
    assert is_entry_point(name)


@pytest.mark.parametrize(
    "name", ["mine", "mine:", ":make", "a b:c", "runs/x", "ppo:model.zip", "1:a"]
)
def test_anything_else(name):
    assert not is_entry_point(name)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    sys.modules.pop("found_here", None)


def test_a_module_in_the_current_folder_is_found(here):
    (here / "found_here.py").write_text("ANSWER = 42\n")
    assert load_module("found_here:ANSWER", "key", "a:b")["ANSWER"] == 42


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot be imported: ModuleNotFoundError"),
        ("raise KeyError('no')", "cannot be imported: KeyError"),
    ],
)
def test_a_module_that_cannot_be_imported(here, text, message):
    if text is not None:
        (here / "found_here.py").write_text(text)
    with pytest.raises(ValueError, match=message):
        load_module("found_here:ANSWER", "key", "a:b")


def test_what_is_none_names_one_that_would_do():
    with pytest.raises(ValueError, match=r"key must be module:attribute, e\.g\. a:b, got 'x'"):
        load_module("x", "key", "a:b")
