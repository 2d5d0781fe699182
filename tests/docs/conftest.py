"""A folder for a page, with the modules in it that the page shows."""

import sys

import pytest

from tests.docs.pages import write_modules


@pytest.fixture
def folder_of(tmp_path, monkeypatch):
    """Make the folder of a page the current one, in which its modules can be imported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    written = []

    def folder_of(page):
        written.extend(write_modules(page, tmp_path))
        for name in written:
            sys.modules.pop(name, None)
        return tmp_path

    yield folder_of
    for name in written:
        sys.modules.pop(name, None)
