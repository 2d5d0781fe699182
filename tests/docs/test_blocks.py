"""Blocks of the documentation: Python runs, a page in one namespace, of episodes one short one.

Settings, models and what programs print are read; for commands see test_commands.
"""

import functools
import re
from xml.etree import ElementTree

import pytest
import yaml
from sybil import Lexeme
from sybil.evaluators.python import PythonEvaluator

from flyrl.cli.tune import compose_training, read_space
from flyrl.front.study import search_space
from tests.docs.pages import LANGUAGES, PAGES, ROOT, blocks, openings, pages_with


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_of_a_language_that_is_run_or_checked(page):
    found = openings(page)
    assert set(found) <= set(LANGUAGES)
    assert len(blocks(page, *LANGUAGES)) == len(found)


RECIPES = r"flyrl\.(train|evaluate)\([^()]*progress_bar=False"
"""Trainings and evaluations of tasks whose episodes are long, up to an argument."""


@pytest.mark.parametrize("page", pages_with("python"))
def test_the_python_of_a_page_runs(page, folder_of):
    folder_of(page)
    evaluate = PythonEvaluator()
    examples = blocks(page, "python")
    examples[0].namespace.clear()
    for example in examples:
        given = example.parsed
        shorter = re.sub(r"episodes=\d+", "episodes=1", given)
        shorter = re.sub(RECIPES, r"\g<0>, time_limit=0.4", shorter)
        example.parsed = Lexeme(shorter, given.offset, given.line_offset)
        evaluate(example)


@pytest.mark.parametrize("page", pages_with("yaml", "xml"))
def test_settings_and_models_can_be_read(page):
    for block in blocks(page, "yaml"):
        if "--8<--" not in block.parsed:  # a whole file, which mkdocs puts there
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
