"""Blocks of the documentation that are not run: settings, models, and what programs print."""

import functools
import re
from xml.etree import ElementTree

import pytest
import yaml

from flyrl.cli.tune import compose_training, read_space
from flyrl.front.study import search_space
from tests.docs.pages import ROOT, blocks, pages_with

_SNIPPET = "--8<--"


@pytest.mark.parametrize("page", pages_with("yaml", "xml"))
def test_settings_and_models_can_be_read(page):
    for block in blocks(page, "yaml"):
        if _SNIPPET not in block.parsed:  # a whole file, which mkdocs puts there
            assert yaml.safe_load(block.parsed)
    for block in blocks(page, "xml"):
        assert len(ElementTree.fromstring(f"<mujoco>{block.parsed}</mujoco>"))


def test_the_search_space_is_one(tmp_path):
    (block,) = blocks("docs/sweeps.md", "yaml")
    path = tmp_path / "mine.yaml"
    path.write_text(block.parsed)
    assert len(search_space(read_space(path), compose_training([]), str(path))) == 4


@functools.cache
def _sources():
    """All modules, with texts that go over several lines in one piece."""
    text = "".join(path.read_text() for path in sorted((ROOT / "flyrl").rglob("*.py")))
    return re.sub(r'"\s*\n\s*f?"', "", text)


SHOWN = [block.parsed.strip() for block in blocks("docs/troubleshooting.md", "text")]


# errors are brought about by the command before them (test_commands)
@pytest.mark.parametrize("message", [each for each in SHOWN if not each.startswith("error: ")])
def test_a_message_is_one_of_the_sources(message):
    for part in filter(None, (part.strip() for part in message.split("…"))):
        assert part in _sources()
