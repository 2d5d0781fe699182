"""Every block of Python in the documentation runs, a page in one namespace, of episodes one."""

import re

import pytest
from sybil import Lexeme
from sybil.evaluators.python import PythonEvaluator

from tests.docs.pages import LANGUAGES, PAGES, blocks, openings, pages_with


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_of_a_language_that_is_run_or_checked(page):
    found = openings(page)
    assert set(found) <= set(LANGUAGES)
    assert len(blocks(page, *LANGUAGES)) == len(found)


@pytest.mark.parametrize("page", pages_with("python"))
def test_the_python_of_a_page_runs(page, folder_of):
    folder_of(page)
    evaluate = PythonEvaluator()
    examples = blocks(page, "python")
    examples[0].namespace.clear()
    for example in examples:
        given = example.parsed
        shorter = re.sub(r"episodes=\d+", "episodes=1", given)
        example.parsed = Lexeme(shorter, given.offset, given.line_offset)
        evaluate(example)
