"""A folder for a page, with the modules in it that the page shows."""

import re

import pytest

from tests.docs.pages import blocks


@pytest.fixture
def folder_of(tmp_path, own_module, monkeypatch):
    """Write the modules of a page, which begin as `# my_terms.py` does, to the current folder."""
    monkeypatch.syspath_prepend(tmp_path)

    def folder_of(page):
        for block in blocks(page, "python"):
            if module := re.match(r"# (\w+)\.py\n", block.parsed):
                own_module(module[1], block.parsed)
        return tmp_path

    return folder_of
